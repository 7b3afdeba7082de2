#include "analysis/paper/uncharged_sticking.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

#include "analysis/study/setting.h"

namespace metastable::analysis {
namespace {

Setting equal_legs() {
  Setting setting;
  setting.wheel.leg_length.assign(8, 0.1519);
  return setting;
}

TEST(UnchargedSticking, IsThePublishedLawBelowTheCriticalFriction) {
  const dynamics::WheelMap map = equal_legs().map();
  const UnchargedSticking uncharged(map);
  const double critical = uncharged.sticking_friction(0);
  // Here x = L cos(beta), y = L sin(beta), beta = 67.5 deg.
  const double beta = 3 * std::numbers::pi / 8, s = std::sin(beta);
  EXPECT_NEAR(critical, std::cos(beta) * s / (1 + s * s), 1e-12);
  for (const double omega : {2.0, 5.0}) {
    const double x = omega * omega;
    EXPECT_EQ(uncharged.after_collision(x, 0, {0.4, critical - 0.01}),
              map.after_collision(x, 0, {0.4, critical - 0.01}));
    // Above, what is saved is the friction loss and the shift along the ramp, by the law's own account.
    const dynamics::Loss loss = map.loss(0, omega, {0.4, 0.4});
    EXPECT_GT(loss.tangential(), 0);
    EXPECT_NEAR(uncharged.after_collision(x, 0, {0.4, 0.4}) - map.after_collision(x, 0, {0.4, 0.4}),
                2 * (loss.tangential() - loss.potential) / map.stance(0).inertia, 1e-9 * x);
  }
}

TEST(UnchargedSticking, TableLandsLikeTheMap) {
  const UnchargedSticking uncharged(equal_legs().map());
  std::vector<double> score, next(9);
  for (int k = 0; k < 9; ++k) score.insert(score.end(), {0.7 * (k % 3 - 1), 0.9 * (k / 3 - 2)});
  UnchargedSticking::Table table = uncharged.tabulate(0, score);
  const std::vector<double> offset(9, 0.5);
  table.land(20, 10, offset, 0, next);
  for (std::size_t k = 0; k < 9; ++k) {
    const auto landed = uncharged.landing(25, 0, std::span(score).subspan(2 * k, 2));
    ASSERT_EQ(std::isfinite(next[k]), landed.has_value());
    if (landed) {
      EXPECT_NEAR(next[k], *landed, 1e-13 * *landed);
    }
  }
}

TEST(UnchargedSticking, RefusesOtherLaws) {
  Setting setting = equal_legs();
  setting.law = dynamics::Law::coulomb;
  EXPECT_THROW(UnchargedSticking(setting.map()), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
