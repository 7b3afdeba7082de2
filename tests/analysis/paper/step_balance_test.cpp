#include "analysis/paper/step_balance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {
namespace {

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
  // A point mass and equal legs keep cos^2 of the leg angle.
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
