#include "dynamics/return_map/launch_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace metastable::dynamics {
namespace {

// Returns a normal by its quantiles, half an sd apart.
LaunchSpeed tabulated(const TruncatedNormal& normal) {
  std::vector<double> score, speed;
  for (double z = -8; z <= 8; z += 0.5) {
    score.push_back(z);
    speed.push_back(normal.at_score(z));
  }
  return {score, speed};
}

TEST(LaunchSpeed, QuantilesOfANormalAreThatNormal) {
  const TruncatedNormal normal(5, 0.2, 0);
  const LaunchSpeed table = tabulated(normal), itself(normal);
  for (const double z : {-3.1, -0.7, 0.0, 0.2, 2.9}) {
    EXPECT_NEAR(table.at_score(z), normal.at_score(z), 1e-9) << z;
    EXPECT_NEAR(table.density(normal.at_score(z)), normal.density(normal.at_score(z)), 1e-6) << z;
    EXPECT_EQ(itself.at_score(z), normal.at_score(z)) << z;
  }
  EXPECT_NEAR(table.mean(), 5, 1e-9);
  EXPECT_NEAR(table.sd(), 0.2, 1e-9);
  EXPECT_TRUE(itself.normal());
  EXPECT_FALSE(table.normal());
}

TEST(LaunchSpeed, RisesBetweenItsQuantilesAndStaysBeyond) {
  const LaunchSpeed uneven({-2, -1, 0, 0.1, 3}, {1, 1, 1.001, 4, 4.5});
  double last = 0;
  for (double z = -4; z <= 4; z += 0.01) {
    EXPECT_GE(uneven.at_score(z), last - 1e-15) << z;
    last = uneven.at_score(z);
  }
  EXPECT_EQ(uneven.at_score(-38), 1);
  EXPECT_EQ(uneven.at_score(38), 4.5);
  EXPECT_EQ(uneven.density(0.9), 0);
  EXPECT_EQ(uneven.density(5), 0);
}

TEST(LaunchSpeed, OneQuantileIsAConstant) {
  const LaunchSpeed constant({0}, {5});
  EXPECT_TRUE(constant.constant());
  EXPECT_EQ(constant.at_score(1), 5);
  EXPECT_EQ(constant.mean(), 5);
  EXPECT_EQ(constant.sd(), 0);
  EXPECT_THROW(constant.density(5), std::logic_error);
}

TEST(LaunchSpeed, NormalsAreCutOffAtRest) {
  const LaunchSpeed slow(TruncatedNormal(0.1, 1));
  EXPECT_GE(slow.at_score(-8), 0);
}

TEST(LaunchSpeed, RefusesWhatIsNoDistribution) {
  EXPECT_THROW(LaunchSpeed({}, {}), std::invalid_argument);
  EXPECT_THROW(LaunchSpeed({0, 1}, {1}), std::invalid_argument);
  EXPECT_THROW(LaunchSpeed({0, 1}, {2, 1}), std::invalid_argument);
  EXPECT_THROW(LaunchSpeed({1, 0}, {1, 2}), std::invalid_argument);
  EXPECT_THROW(LaunchSpeed({0}, {-1}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::dynamics
