#include "analysis/wheel_model/score_tilt.h"

#include <gtest/gtest.h>

#include <cmath>

namespace metastable::analysis {
namespace {

TEST(ScoreTilt, IsADistributionWithItsDensity) {
  const ScoreTilt tilt(0.3, -0.2);
  EXPECT_DOUBLE_EQ(tilt.below(0), 0);
  EXPECT_NEAR(tilt.below(1), 1, 1e-12);
  for (double u = 0.01; u < 0.99; u += 0.0173) {
    EXPECT_NEAR((tilt.below(u + 1e-5) - tilt.below(u - 1e-5)) / 2e-5, std::exp(tilt.log_density(u)), 1e-5);
    EXPECT_LE(std::exp(tilt.log_density(u)), tilt.largest_density() * (1 + 1e-3));
  }
  // The lower tail keeps its relative accuracy: rest is rare.
  EXPECT_NEAR(tilt.below(1e-9) / (1e-9 * std::exp(tilt.log_density(0))), 1, 1e-6);
}

TEST(ScoreTilt, WithoutTiltChangesNothing) {
  const ScoreTilt tilt(0, 0);
  EXPECT_EQ(tilt.below(0.3), 0.3);
  EXPECT_EQ(tilt.log_density(0.3), 0);
}

}  // namespace
}  // namespace metastable::analysis
