#include "analysis/wheel_model/wheel_simulation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

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
TEST(WheelSimulation, ScoresOfItsOwnDataAreStandardNormal) {
  for (const bool speeds_after : {true, false}) {
    const auto design = wheel_transitions(test::wheel_design(150, 16, speeds_after));
    const auto data = design->simulate(nominal_values(*design), {}, 5);
    const Evaluation e = data->evaluate(nominal_values(*data), {});
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

// Returns the mean product of each event's score and that so many events later in its trial.
double correlation(const TransitionModel& model, const Evaluation& e, std::size_t lag) {
  double sum = 0, count = 0;
  for (std::size_t i = lag; i < e.score.size(); ++i)
    if (model.events()[i].trial == model.events()[i - lag].trial && is_contact(model.events()[i].kind)) {
      sum += e.score[i] * e.score[i - lag];
      count += 1;
    }
  return sum / count;
}

// A belief that takes the noise for what contacts scatter misses it again, with the other sign, at the next speed:
// wheels with constant contacts were said to remember them.
TEST(WheelSimulation, ScoresOfContactsBelowTheNoiseAreStandardNormalAndForgetful) {
  for (const double sd : {0.0, 0.002, 0.004, 0.006, 0.008, 0.012, 0.02})
    for (const bool speeds_after : {true, false}) {
      Experiment e = test::wheel_design(240, 16, speeds_after);
      e.contact.restitution.sd = e.contact.friction.sd = sd;
      e.sensor.noise_sd = 0.02;
      const auto design = wheel_transitions(e);
      const auto data = design->simulate(nominal_values(*design), {}, 5);
      const Evaluation seen = data->evaluate(nominal_values(*data), {});
      for (const EventKind kind : {speeds_after ? EventKind::collision : EventKind::step, EventKind::stance}) {
        if (kind == EventKind::stance && !speeds_after) continue;
        const Moments m = moments(*data, seen, kind);
        EXPECT_NEAR(m.mean, 0, 4 / std::sqrt(m.count)) << sd << ' ' << speeds_after;
        EXPECT_NEAR(m.square, 1, 4 * std::sqrt(2 / m.count)) << sd << ' ' << speeds_after;
        for (const std::size_t lag : {std::size_t{1}, std::size_t{2}})
          EXPECT_NEAR(correlation(*data, seen, lag), 0, 4 / std::sqrt(m.count)) << sd << ' ' << speeds_after;
      }
    }
}

TEST(WheelSimulation, SameSeedSameData) {
  const auto design = wheel_transitions(test::wheel_design(6, 5));
  const auto a = design->simulate(nominal_values(*design), {}, 9), b = design->simulate(nominal_values(*design), {}, 9),
             c = design->simulate(nominal_values(*design), {}, 10);
  EXPECT_EQ(a->evaluate(nominal_values(*a), {}).log_density, b->evaluate(nominal_values(*b), {}).log_density);
  EXPECT_NE(a->evaluate(nominal_values(*a), {}).log_density, c->evaluate(nominal_values(*c), {}).log_density);
}

}  // namespace
}  // namespace metastable::analysis
