#include "dynamics/numerics/normal_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {
namespace {

TEST(NormalTable, IsErfcAndExp) {
  std::vector<double> z;
  for (double at = -8; at < 8; at += 0.00137) z.push_back(at);
  std::vector<double> below(z.size()), density(z.size());
  normals_at(z.data(), z.size(), below.data(), density.data());
  for (std::size_t k = 0; k < z.size(); ++k) {
    EXPECT_NEAR(below[k] / normal_cdf(z[k]), 1, 1e-9) << z[k];
    EXPECT_NEAR(density[k] / normal_density(z[k]), 1, 1e-9) << z[k];
  }
}

TEST(NormalTable, EndsAtEight) {
  const double z[] = {-1e300, -8, 8, 1e300, std::nan("")};
  double below[5], density[5];
  normals_at(z, 5, below, density);
  EXPECT_EQ(below[0], below[1]);
  EXPECT_EQ(below[2], below[3]);
  EXPECT_LT(below[0], 1e-15);
  EXPECT_GT(below[3], 1 - 1e-15);
  EXPECT_EQ(density[0], density[3]);
  EXPECT_EQ(below[4], below[0]);
}

}  // namespace
}  // namespace metastable::dynamics
