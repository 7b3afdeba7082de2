#include "dynamics/return_map/landing_range.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// It starts from the slowest state a survivor can have: if rest is unreachable from there it is unreachable.
bool rest_reachable(double slope) {
  const WheelMap map(even_wheel(), slope, Law::coulomb, paper_noise);
  return map.landing_range(map.state_interval(0).first, 0).first == -infinity;
}

TEST(LandingRange, CoulombRestIsUnreachableOnThePapersRamps) {
  EXPECT_FALSE(rest_reachable(7.02 * degree));
  EXPECT_FALSE(rest_reachable(9.59 * degree));
  EXPECT_TRUE(rest_reachable(3.46 * degree));
  EXPECT_FALSE(rest_reachable(3.48 * degree));
}

TEST(LandingRange, PublishedFootCanAlwaysJam) {
  const WheelMap map(even_wheel(), 9.59 * degree, Law::published, paper_noise);
  EXPECT_EQ(map.landing_range(200, 0).first, -infinity);
  EXPECT_GT(map.landing_range(200, 0).second, 200);
}

TEST(LandingRange, LosslessCollisionIsTheSupremumOfCoulomb) {
  const WheelMap map(Wheel(), 7.02 * degree, Law::coulomb, paper_noise);
  for (int p = 0; p < 8; ++p) {
    const double lossless = map.stance((p + 7) % 8).inertia / map.stance(p).inertia * 30;
    EXPECT_NEAR(map.landing_range(30, p).second, lossless + map.stance(p).gain, 1e-9);
  }
}

RC_GTEST_PROP(LandingRange, HoldsEveryLanding, ()) {
  const Law law = *rc::gen::element(Law::published, Law::coulomb, Law::plastic);
  const WheelMap map(even_wheel(), uniform(3, 12) * degree, law, paper_noise);
  const double state = uniform(5, 60), eta = uniform(0, 1), mu = uniform(0, 4);
  const auto [least, most] = after_collision_range(map, state, 0);
  const double after = map.after_collision(state, 0, {eta, mu});
  RC_ASSERT(least <= after + 1e-9 && after <= most + 1e-9);
}

TEST(LandingRange, ListAndConstantAreTheirOwnRange) {
  const WheelMap list(even_wheel(), 7.02 * degree, Law::published, ContactNoise::empirical({{0.4, 0.3}, {0.5, 0.2}}));
  const double a = list.after_collision(30, 0, {0.4, 0.3}), b = list.after_collision(30, 0, {0.5, 0.2});
  EXPECT_EQ(after_collision_range(list, 30, 0), std::pair(std::min(a, b), std::max(a, b)));
  const WheelMap constant(even_wheel(), 7.02 * degree, Law::published, ContactNoise::normal(0.4, 0, 0.3, 0));
  EXPECT_EQ(after_collision_range(constant, 30, 0), std::pair(a, a));
}

}  // namespace
}  // namespace metastable::dynamics::test
