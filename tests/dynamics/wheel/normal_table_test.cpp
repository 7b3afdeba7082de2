#include "dynamics/wheel/normal_table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/wheel/truncated_normal.h"

namespace metastable::dynamics {
namespace {

TEST(NormalTable, IsErfcAndExp) {
  for (double z = -12; z < 12; z += 0.00137) {
    const NormalAt at = normal_at(z);
    EXPECT_NEAR(at.below / normal_cdf(z), 1, 1e-9) << z;
    EXPECT_NEAR(at.density / normal_density(z), 1, 1e-9) << z;
  }
  EXPECT_EQ(normal_at(-60).below, 0);
  EXPECT_EQ(normal_at(60).below, 1);
}

TEST(NormalTable, OfNoNumberIsNone) { EXPECT_TRUE(std::isnan(normal_at(std::nan("")).below)); }

}  // namespace
}  // namespace metastable::dynamics
