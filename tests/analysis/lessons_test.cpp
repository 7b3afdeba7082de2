// Behind the worked examples: the published law without its charge on sticking, and the balance of whole steps.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "analysis/setting.h"
#include "analysis/step_balance.h"
#include "analysis/uncharged_sticking.h"

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
  // x = L cos(beta), y = L sin(beta), beta = 67.5 deg.
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

// Steps made with a known departure from the plastic collision, in slide and energy, come back.
TEST(StepBalance, FindsWhatStepsLackAndWhatItGoesWith) {
  Experiment e;
  e.contact.law = dynamics::Law::coulomb;
  e.conditions = {{"ramp", 9.59, 10, {}, 0}};
  e.columns = {Presence::all, Presence::none, Presence::all, Presence::none, false};
  const dynamics::WheelMap plastic(e.wheel, 9.59 * std::numbers::pi / 180, dynamics::Law::coulomb,
                                   dynamics::ContactNoise::empirical({{0, 10}}));
  for (int t = 0; t < 6; ++t) {
    MeasuredTrial trial;
    trial.number = t + 1;
    double x = 30, position = 0;
    for (int k = 0; k < 20; ++k) {
      const int leg = k % 8;
      MeasuredCollision c;
      c.number = k + 1;
      c.leg = leg;
      c.position = position;
      c.omega_minus = std::sqrt(x);
      trial.collisions.push_back(c);
      const double slide = (k + t) % 5 == 0 ? 0.01 : 0.001;
      x = (plastic.coefficients(leg, {0, 10}).scale - 2 * slide) * x + plastic.stance(leg).gain;
      position += plastic.advance(leg) + slide;
    }
    e.trials.push_back(trial);
  }
  const StepBalances b = step_balances(e);
  ASSERT_EQ(b.conditions.size(), 1u);
  EXPECT_EQ(b.conditions[0].steps, 96u);  // collisions 4 to 19 of six trials
  EXPECT_NEAR(b.conditions[0].median, -0.002, 1e-9);
  EXPECT_NEAR(b.conditions[0].low, -0.02, 1e-9);
  ASSERT_TRUE(b.correlation.slide);
  EXPECT_NEAR(*b.correlation.slide, -1, 1e-9);
  EXPECT_FALSE(b.correlation.after_collision);
  ASSERT_EQ(b.slides.size(), 5u);
  EXPECT_NEAR(*b.slides[0].slide, 0.001, 1e-9);
  EXPECT_EQ(b.legs.size(), 8u);
  // A point mass and equal legs: cos^2 of the leg angle.
  e.wheel.leg_length.assign(8, 0.15);
  e.wheel.radius_of_gyration = 1e-9;
  EXPECT_NEAR(step_balances(e).conditions[0].plastic, 0.5, 1e-6);
}

TEST(StepBalance, SaysWhatItLacks) {
  Experiment e;
  e.conditions = {{"ramp", 9.59, 10, {}, 0}};
  EXPECT_THROW(step_balances(e), std::invalid_argument);  // no legs
  e.columns.leg = Presence::all;
  EXPECT_THROW(step_balances(e), std::invalid_argument);  // no steps
}

}  // namespace
}  // namespace metastable::analysis
