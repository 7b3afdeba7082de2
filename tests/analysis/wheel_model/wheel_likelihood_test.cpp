#include "analysis/wheel_model/wheel_likelihood.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/return_map/wheel_map.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

// The filter on one step without noise is the exact density of the landing: another route to the same number.
TEST(WheelLikelihood, OneStepIsTheLandingDensity) {
  Experiment e = test::wheel_design(2, 2, false);
  e.sensor.noise_sd.reset();
  for (Condition& c : e.conditions) c.initial_speed.reset();
  e.trials[0].collisions[0].omega_minus = 5.3;
  e.trials[0].collisions[1].omega_minus = 5.5;
  const auto model = wheel_transitions(e);
  const Evaluation evaluation = model->evaluate(nominal_values(*model), {});
  const dynamics::WheelMap map(dynamics::Wheel{}, 9.59 * std::numbers::pi / 180, dynamics::Law::published,
                               dynamics::ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
  const std::vector<double> next{5.5 * 5.5};
  std::vector<double> density(1);
  map.landing_density(5.3 * 5.3, 0, next, density);
  ASSERT_EQ(model->events()[0].kind, EventKind::step);
  EXPECT_NEAR(std::exp(evaluation.log_density[0]), density[0] * 2 * 5.5, 1e-3 * density[0] * 11);
}

TEST(WheelLikelihood, RestHasTheMapsProbability) {
  Experiment e = test::wheel_design(2, 2, false);
  e.sensor.noise_sd.reset();
  for (Condition& c : e.conditions) c.initial_speed.reset();
  for (MeasuredTrial& trial : e.trials) trial.collisions.resize(1);
  e.trials[0].collisions[0].omega_minus = 4.0;
  e.trials[0].outcome = dynamics::Outcome::rest;
  e.trials[1].collisions.push_back(
      {.number = 2, .leg = 1, .time = 0.2, .position = 0.116, .omega_minus = 5.5, .omega_plus = {}});
  const auto model = wheel_transitions(e);
  const Evaluation evaluation = model->evaluate(nominal_values(*model), {});
  const dynamics::WheelMap map(dynamics::Wheel{}, 9.59 * std::numbers::pi / 180, dynamics::Law::published,
                               dynamics::ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
  ASSERT_EQ(model->events()[0].kind, EventKind::rest);
  EXPECT_NEAR(std::exp(evaluation.log_density[0]) / *map.rest_probability(16, 0), 1, 0.01);
}

}  // namespace
}  // namespace metastable::analysis
