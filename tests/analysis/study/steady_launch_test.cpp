#include "analysis/study/steady_launch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "analysis/study/certify.h"
#include "dynamics/return_map/trials.h"
#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Setting steady(Setting setting, Spread friction) {
  setting.steady_launch = true;
  setting.friction = friction;
  return setting;
}

// From the quasi-stationary distribution every step fails alike: T = 1 / rate, and P(steps > n) = (1 - rate)^n.
TEST(SteadyLaunch, IsTheRegimeOfEqualLegs) {
  for (const Method method : {Method::sampled, Method::integrated})
    for (const Spread friction : {Spread{0.4, 0.1}, Spread{0.35, 0.08}}) {
      const Metastability found = study(steady(paper_setting(7.02, true), friction), {.method = method});
      const StepsToRest& steps = found.steps;
      EXPECT_NEAR(steps.from_start.value / steps.from_quasi_stationary.value, 1, 2e-3);
      for (const int n : {1, 5, 20})
        EXPECT_NEAR(steps.survival[static_cast<std::size_t>(n)] / std::pow(1 - found.spectrum.failure_rate.value, n), 1,
                    5e-3)
            << n;
      EXPECT_NEAR(found.setting->initial_speed.mean, found.survivors.mean, 1e-3);
      EXPECT_NEAR(found.setting->initial_speed.sd, found.survivors.sd, 2e-3);
    }
}

// Wheels that still roll after 60 collisions have those speeds when that leg lands.
TEST(SteadyLaunch, IsWhatSurvivorsHaveLegByLeg) {
  Setting setting = steady(paper_setting(7.02, false), {0.3, 0.08});
  setting.first_landing_leg = 3;
  const Setting found = steadily_launched(setting, {});
  Setting launched = setting;
  launched.steady_launch = false;
  launched.initial_speed = {6, 0.1};
  double count = 0, sum = 0, squares = 0;
  const dynamics::WheelMap map = launched.map();
  for (std::uint64_t t = 0; t < 4000; ++t) {
    const dynamics::Trial trial =
        dynamics::simulate_trial(map, launched.launch(), {.max_collisions = 64, .ramp_length = 1000, .seed = 5}, t);
    for (const dynamics::TrialCollision& c : trial.collisions) {
      if (c.number < 32 || c.leg != 3) continue;
      ++count, sum += c.omega_minus, squares += c.omega_minus * c.omega_minus;
    }
  }
  const double mean = sum / count, sd = std::sqrt(squares / count - mean * mean);
  EXPECT_GT(count, 500);
  EXPECT_NEAR(found.initial_speed.mean, mean, 4 * sd / std::sqrt(count));
  EXPECT_NEAR(found.initial_speed.sd, sd, 4 * sd / std::sqrt(2 * count));
  EXPECT_NE(found.describe().find("omega_0 of the metastable regime ("), std::string::npos) << found.describe();
}

TEST(SteadyLaunch, OfAWheelThatNeverRestsIsStationary) {
  Setting setting = steady(paper_setting(7.02, true), {0.4, 0.1});
  setting.law = dynamics::Law::coulomb;
  const Metastability found = study(setting, {.cells = 64, .samples = 1024});
  EXPECT_EQ(found.status, Status::rest_unreachable);
  EXPECT_NEAR(found.setting->initial_speed.mean, found.survivors.mean, 0.01);
}

TEST(SteadyLaunch, OfAWheelWithoutNoiseIsItsOrbit) {
  Setting setting = steady(paper_setting(7.02, false), {0.3, 0});
  setting.restitution.sd = 0;
  const Setting found = steadily_launched(setting, {});
  EXPECT_EQ(found.initial_speed.sd, 0);
  const dynamics::Trial trial =
      dynamics::simulate_trial(found.map(), found.launch(), {.max_collisions = 9, .ramp_length = 1000}, 0);
  ASSERT_EQ(trial.collisions.size(), 9U);
  EXPECT_NEAR(trial.collisions[8].omega_minus, trial.collisions[0].omega_minus, 1e-9);
  setting.slope_deg = 1;
  EXPECT_THROW(steadily_launched(setting, {}), NoRegime);
}

TEST(SteadyLaunch, SaysWhereNoWheelRollsOn) {
  Setting setting = steady(paper_setting(7.02, true), {0.4, 0.02});
  setting.slope_deg = 0.2;
  EXPECT_EQ(message_of<NoRegime>([&] {
              study(setting, {});
            }).rfind("initial speed: steady: fewer than 1e-12 of the wheels survive", 0),
            0U);
}

TEST(SteadyLaunch, IsFoundBeforeItIsReadAndHasNoCertificate) {
  const Setting setting = steady(paper_setting(7.02, true), {0.4, 0.1});
  EXPECT_THROW(setting.launch(), std::logic_error);
  EXPECT_NO_THROW(setting.validate());
  EXPECT_FALSE(certify(setting, {}).exists);
  const Setting given = paper_setting(7.02, true);
  EXPECT_FALSE(steadily_launched(given, {}).steady_speed);
}

TEST(SteadyLaunch, UnderSettledIsThatOfTheRolledWheel) {
  Setting setting = steady(paper_setting(7.02, true), {0.45, 0.1});
  setting.law = dynamics::Law::settled;
  const StudyOptions options{.cells = 64, .samples = 1024};
  const Metastability found = study(setting, options);
  EXPECT_NEAR(found.steps.from_start.value / found.steps.from_quasi_stationary.value, 1, 0.02);
}

}  // namespace
}  // namespace metastable::analysis
