#include "analysis/wheel_transitions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "analysis/model_fit.h"
#include "dynamics/wheel_map.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

using test::nominal;
using test::term;

struct Moments {
  double count = 0, mean = 0, square = 0;
};
Moments moments(const TransitionModel& model, const Evaluation& e, EventKind kind) {
  Moments m;
  for (std::size_t i = 0; i < e.score.size(); ++i)
    if (model.events()[i].kind == kind) {
      m.count += 1;
      m.mean += e.score[i];
      m.square += e.score[i] * e.score[i];
    }
  m.mean /= m.count;
  m.square /= m.count;
  return m;
}

// Under the model's own data every score is standard normal, whatever is measured.
TEST(WheelTransitions, ScoresOfItsOwnDataAreStandardNormal) {
  for (const bool speeds_after : {true, false}) {
    const auto design = wheel_transitions(test::wheel_design(150, 16, speeds_after));
    const auto data = design->simulate(nominal(*design), {}, 5);
    const Evaluation e = data->evaluate(nominal(*data), {});
    for (const EventKind kind : {EventKind::launch, speeds_after ? EventKind::collision : EventKind::step}) {
      const Moments m = moments(*data, e, kind);
      EXPECT_NEAR(m.mean, 0, 4 / std::sqrt(m.count));
      EXPECT_NEAR(m.square, 1, 4 * std::sqrt(2 / m.count));
    }
    if (!speeds_after) continue;
    const Moments m = moments(*data, e, EventKind::stance);
    EXPECT_NEAR(m.mean, 0, 4 / std::sqrt(m.count));
    EXPECT_NEAR(m.square, 1, 4 * std::sqrt(2 / m.count));
  }
}

// The filter on one step without noise is the exact density of the landing: another route to the same number.
TEST(WheelTransitions, OneStepIsTheLandingDensity) {
  Experiment e = test::wheel_design(2, 2, false);
  e.sensor.noise_sd.reset();
  for (Condition& c : e.conditions) c.initial_speed.reset();
  e.trials[0].collisions[0].omega_minus = 5.3;
  e.trials[0].collisions[1].omega_minus = 5.5;
  const auto model = wheel_transitions(e);
  const Evaluation evaluation = model->evaluate(nominal(*model), {});
  const dynamics::WheelMap map(dynamics::Wheel{}, 9.59 * std::numbers::pi / 180, dynamics::Law::published,
                               dynamics::ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
  const std::vector<double> next{5.5 * 5.5};
  std::vector<double> density(1);
  map.landing_density(5.3 * 5.3, 0, next, density);
  ASSERT_EQ(model->events()[0].kind, EventKind::step);
  EXPECT_NEAR(std::exp(evaluation.log_density[0]), density[0] * 2 * 5.5, 1e-3 * density[0] * 11);
}

TEST(WheelTransitions, RestHasTheMapsProbability) {
  Experiment e = test::wheel_design(2, 2, false);
  e.sensor.noise_sd.reset();
  for (Condition& c : e.conditions) c.initial_speed.reset();
  for (MeasuredTrial& trial : e.trials) trial.collisions.resize(1);
  e.trials[0].collisions[0].omega_minus = 4.0;
  e.trials[0].outcome = dynamics::Outcome::rest;
  e.trials[1].collisions.push_back(
      {.number = 2, .leg = 1, .time = 0.2, .position = 0.116, .omega_minus = 5.5, .omega_plus = {}});
  const auto model = wheel_transitions(e);
  const Evaluation evaluation = model->evaluate(nominal(*model), {});
  const dynamics::WheelMap map(dynamics::Wheel{}, 9.59 * std::numbers::pi / 180, dynamics::Law::published,
                               dynamics::ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
  ASSERT_EQ(model->events()[0].kind, EventKind::rest);
  EXPECT_NEAR(std::exp(evaluation.log_density[0]) / *map.rest_probability(16, 0), 1, 0.01);
}

// Fitted effects find the sizes the data were drawn with.
TEST(WheelTransitions, FitsFindTheSizesOfEffects) {
  const auto design = wheel_transitions(test::wheel_design(120, 14));
  struct Case {
    const char* id;
    std::vector<double> variant, values;
  };
  const std::vector<Case> cases{{"leg_contact", {3, 0}, {1.15}},
                                {"rolling_resistance", {}, {0.004}},
                                {"contact_memory", {}, {0.3}},
                                {"trial_drift", {}, {0.2}},
                                {"trial_spread", {}, {0.02 * 0.02}},
                                {"friction_patch", {0.4, 0.9}, {0.85}},
                                {"hub_eccentricity", {}, {2e-4, -1e-4}},
                                {"sensor_noise", {}, {1e-4}},
                                {"sensor_bias", {1, 1}, {0.02}}};
  for (const Case& one : cases) {
    const Term truth = term(*design, one.id, one.variant, one.values);
    const auto data = design->simulate(nominal(*design), std::vector{truth}, 11);
    Term start = term(*data, one.id, one.variant, one.values);
    for (double& value : start.values) value *= 0.9;
    const Fit found = fit(*data, nominal(*data), {start});
    EXPECT_TRUE(found.converged) << one.id << ' ' << found.reason;
    const Eigen::MatrixXd covariance = found.information.inverse();
    for (std::size_t p = 0; p < one.values.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(nominal(*data).size() + p);
      EXPECT_NEAR(found.terms[0].values[p], one.values[p], 4 * std::sqrt(covariance(at, at))) << one.id << ' ' << p;
    }
    EXPECT_GT(found.penalised, fit(*data, nominal(*data), {}).penalised + 8) << one.id;
  }
}

TEST(WheelTransitions, LegsThatWereNotNotedAreFoundFromTheStances) {
  const auto design = wheel_transitions(test::wheel_design(20, 10));
  const auto data = design->simulate(nominal(*design), {}, 3);
  Experiment e = test::wheel_design(20, 10);
  e.columns.leg = Presence::none;
  // The simulated speeds, without legs.
  std::size_t event = 0;
  for (MeasuredTrial& trial : e.trials)
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) trial.collisions[k].leg.reset();
  for (; event < data->events().size(); ++event) {
    const Event& one = data->events()[event];
    auto& trial = e.trials[one.trial];
    if (static_cast<std::size_t>(one.number) > trial.collisions.size()) continue;
    MeasuredCollision& c = trial.collisions[static_cast<std::size_t>(one.number) - 1];
    if (one.kind == EventKind::collision) c.omega_minus = one.speed;
    if (one.kind == EventKind::stance) c.omega_plus = one.speed;
  }
  const auto model = wheel_transitions(e);
  EXPECT_EQ(model->legs(), 8);
  std::size_t right = 0, stances = 0;
  for (const Event& one : model->events())
    if (one.kind == EventKind::stance && one.leg) {
      ++stances;
      right += *one.leg == (one.number - 1) % 8;
    }
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(stances));
  EXPECT_FALSE(model->notes().empty());
}

TEST(WheelTransitions, SameSeedSameData) {
  const auto design = wheel_transitions(test::wheel_design(6, 5));
  const auto a = design->simulate(nominal(*design), {}, 9), b = design->simulate(nominal(*design), {}, 9),
             c = design->simulate(nominal(*design), {}, 10);
  EXPECT_EQ(a->evaluate(nominal(*a), {}).log_density, b->evaluate(nominal(*b), {}).log_density);
  EXPECT_NE(a->evaluate(nominal(*a), {}).log_density, c->evaluate(nominal(*c), {}).log_density);
}

TEST(WheelTransitions, SaysWhatItCannotRead) {
  Experiment plastic = test::wheel_design(2, 3);
  plastic.contact.law = dynamics::Law::plastic;
  EXPECT_THROW(wheel_transitions(plastic), std::invalid_argument);
  Experiment single = test::wheel_design(3, 1, false);
  EXPECT_THROW(wheel_transitions(single), std::invalid_argument);
  const auto without = wheel_transitions(test::wheel_design(4, 4, false));
  EXPECT_NE(std::find(without->notes().begin(), without->notes().end(),
                      "omega_plus_rad_s is missing: collision and stance cannot be told apart"),
            without->notes().end());
}

}  // namespace
}  // namespace metastable::analysis
