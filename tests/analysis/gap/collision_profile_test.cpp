#include "analysis/gap/collision_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

Fit at_nominal(const TransitionModel& model) {
  Fit fit;
  fit.nuisance = nominal_values(model);
  return fit;
}

// The measured speeds' means and standard errors are taken by hand from the trials.
TEST(CollisionProfile, MeasuredMeansAreThoseOfTheTrials) {
  Experiment e = test::wheel_design(7, 3);  // four trials on the first ramp, three on the second
  for (std::size_t t = 0; t < 7; ++t)
    for (std::size_t k = 0; k < 3; ++k)
      e.trials[t].collisions[k].omega_minus = 5 + 0.1 * static_cast<double>(t * t) - 0.2 * static_cast<double>(k);
  e.trials[0].collisions.resize(2);
  const auto model = wheel_transitions(e);
  const std::vector<ProfilePoint> points = collision_profile(*model, nominal_values(*model), at_nominal(*model), 1);
  ASSERT_EQ(points.size(), 6U);
  for (const ProfilePoint& p : points) {
    double count = 0, sum = 0, squares = 0;
    for (const MeasuredTrial& trial : e.trials)
      if (trial.condition == p.condition && trial.collisions.size() >= static_cast<std::size_t>(p.collision)) {
        const double speed = trial.collisions[static_cast<std::size_t>(p.collision) - 1].omega_minus;
        count += 1;
        sum += speed;
        squares += speed * speed;
      }
    EXPECT_EQ(static_cast<double>(p.trials), count);
    EXPECT_NEAR(p.measured, sum / count, 1e-12);
    EXPECT_NEAR(p.measured_error, std::sqrt((squares - sum * sum / count) / (count - 1) / count), 1e-9);
  }
}

TEST(CollisionProfile, FewerThanThreeTrialsHaveNoMean) {
  const auto model = wheel_transitions(test::wheel_design(5, 2));  // three trials on the first ramp, two on the second
  for (const ProfilePoint& p : collision_profile(*model, nominal_values(*model), at_nominal(*model), 1))
    EXPECT_EQ(p.condition, 0U);
}

// Launches are faster by 0.5 rad/s, on the same random numbers: the first means differ by just that.
TEST(CollisionProfile, SimulatedMeansAreTheModels) {
  const auto model = wheel_transitions(test::wheel_design(200, 3));
  Fit chosen = at_nominal(*model);
  chosen.terms = {test::term(*model, "initial_speed", {}, {0.5, 0})};
  const std::vector<ProfilePoint> points = collision_profile(*model, nominal_values(*model), chosen, 1);
  for (const ProfilePoint& p : points) {
    if (p.collision > 1) {
      EXPECT_GT(p.with_effect, p.baseline);
      continue;
    }
    const double mean = p.condition == 0 ? 5.83 : 7.35, sd = p.condition == 0 ? 0.28 : 0.19;
    EXPECT_NEAR(p.baseline, mean, 4 * sd / std::sqrt(4 * 100.0));
    EXPECT_NEAR(p.with_effect - p.baseline, 0.5, 1e-9);
    EXPECT_NEAR(p.band, 1.96 * std::hypot(sd, 0.008) / std::sqrt(100.0), 0.1 * p.band);
  }
}

}  // namespace
}  // namespace metastable::analysis
