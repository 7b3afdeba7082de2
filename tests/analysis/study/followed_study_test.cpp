#include "analysis/study/followed_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <string>

#include "dynamics/return_map/rough_terrain.h"
#include "dynamics/return_map/trials.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

constexpr std::uint64_t most_simulated = 5000;
constexpr double in_radians = std::numbers::pi / 180;
const StudyOptions brief_sampled{.brief = true}, brief_integrated{.method = Method::integrated, .brief = true};

// A point mass on eight legs of 1 m under `plastic`: x' = x / 2 + 4 g sin(gamma) cos(beta), rest where x / 2 does not
// pass the barrier 2 g (1 - sin(beta + gamma)).
struct PointMass {
  double gain, barrier;
  explicit PointMass(double slope_deg) {
    const double beta = std::numbers::pi / 2 - std::numbers::pi / 8;
    gain = 4 * 9.81 * std::sin(slope_deg * in_radians) * std::cos(beta);
    barrier = 2 * 9.81 * (1 - std::sin(beta + slope_deg * in_radians));
  }
  bool rolls_for_ever() const { return gain >= barrier; }  // its fixed point is 2 gain
  int steps(double omega) const {
    double x = omega * omega;
    for (int n = 1;; ++n) {
      if (x / 2 < barrier) return n;
      x = x / 2 + gain;
    }
  }
  // The launch speed below which it takes no more than n steps.
  double slowest_beyond(int n) const {
    double x = 2 * barrier;
    for (int k = 1; k < n; ++k) x = 2 * (x - gain);
    return std::sqrt(x);
  }
};

Setting point_mass(double slope_deg, Spread launch) {
  Setting setting;
  setting.law = dynamics::Law::plastic;
  setting.wheel.leg_length.assign(8, 1.0);
  setting.wheel.hub_mass = 1;
  setting.wheel.radius_of_gyration = 0;
  setting.slope_deg = slope_deg;
  setting.ramp_length = INFINITY;
  setting.initial_speed = launch;
  return setting;
}

std::uint64_t simulated(const Setting& setting) {
  return dynamics::steps_to_rest(setting.map(), setting.launch(), setting.first_landing_leg, 1, 0, most_simulated);
}

TEST(FollowedStudy, APlasticWheelTakesTheStepsOfItsRecursion) {
  for (double slope = 3.5; slope < 4.1; slope += 0.0237) {
    const PointMass wheel(slope);
    for (const StudyOptions& options : {brief_sampled, brief_integrated}) {
      const Metastability found = study(point_mass(slope, {2, 0}), options);
      if (wheel.rolls_for_ever()) {
        EXPECT_EQ(found.status, Status::rest_unreachable) << slope;
        EXPECT_NEAR(found.survivors.mean, std::sqrt(2 * wheel.gain), 1e-9) << slope;
      } else {
        EXPECT_EQ(found.steps.from_start.value, wheel.steps(2)) << slope;
        EXPECT_EQ(found.steps.from_start.lower, found.steps.from_start.upper);
      }
    }
  }
}

TEST(FollowedStudy, SaysAtWhichSpeedItSettles) {
  const Metastability found = study(point_mass(4.5, {2, 0}), {});
  const std::string speed = "settles at omega- = 1.53";
  EXPECT_NE(found.message.find("infinite: rest is unreachable: without noise it never rests and " + speed),
            std::string::npos)
      << found.message;
}

// Of a launch with a spread the chance of more than n steps is that of a speed above a threshold: a normal's tail.
TEST(FollowedStudy, ALaunchWithASpreadIsIntegratedExactly) {
  const double slope = 3.7;
  const PointMass wheel(slope);
  const Metastability found = study(point_mass(slope, {2, 0.2}), {});
  double expected = 1;
  for (int n = 1; n < 60; ++n) {
    const double beyond = 0.5 * std::erfc((wheel.slowest_beyond(n) - 2) / 0.2 / std::sqrt(2.0));
    expected += beyond;
    EXPECT_NEAR(found.steps.survival[static_cast<std::size_t>(n)], beyond, 1e-9) << n;
  }
  EXPECT_NEAR(found.steps.from_start.value, expected, 1e-8);
  EXPECT_LE(found.steps.from_start.lower, expected + 1e-12);
  EXPECT_GE(found.steps.from_start.upper, expected - 1e-12);
}

// Around where each law's wheel begins to roll for ever, uneven legs too.
TEST(FollowedStudy, EveryLawIsItsDirectSimulation) {
  int resting = 0, rolling = 0;
  for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::plastic})
    for (const bool equal : {true, false})
      for (double slope = 2.9; slope < 7; slope *= 1.053) {
        Setting setting = paper_setting(7.02, equal);
        setting.law = law;
        setting.slope_deg = slope;
        setting.initial_speed = {5, 0};
        setting.restitution = {0.3, 0};
        setting.friction = {0.45, 0};
        setting.first_landing_leg = equal ? 0 : 3;
        const Metastability found = study(setting, brief_integrated);
        const std::uint64_t steps = simulated(setting);
        if (steps < most_simulated) {
          EXPECT_EQ(found.steps.from_start.value, static_cast<double>(steps)) << setting.describe();
          EXPECT_EQ(found.steps.from_start.upper, found.steps.from_start.value);
          ++resting;
        } else {
          EXPECT_EQ(found.status, Status::rest_unreachable) << setting.describe();
          ++rolling;
        }
      }
  EXPECT_GT(resting, 15);
  EXPECT_GT(rolling, 15);
}

TEST(FollowedStudy, SettledIsRolledWithItsMovingFeet) {
  for (const double friction : {0.30, 0.32, 0.335, 0.5}) {
    Setting setting = paper_setting(7.02, false);
    setting.law = dynamics::Law::settled;
    setting.restitution = {0.4, 0};
    setting.friction = {friction, 0};
    setting.initial_speed = {7.35, 0};
    const Metastability found = study(setting, brief_sampled);
    const std::uint64_t steps =
        dynamics::steps_to_rest(setting.motion(), setting.noise(), setting.launch(), 0, 1, 0, 500);
    if (steps < 500) {
      EXPECT_EQ(found.steps.from_start.value, static_cast<double>(steps)) << friction;
    } else {
      EXPECT_EQ(found.status, Status::rest_unreachable) << friction;
    }
  }
}

// Noise that is far narrower than cells: whatever answers, its interval holds the trials' mean.
TEST(FollowedStudy, NarrowNoiseIsNotSmeared) {
  for (const double sd : {1e-8, 1e-4})
    for (const double slope : {3.0, 3.04}) {
      Setting setting = paper_setting(7.02, true);
      setting.law = dynamics::Law::coulomb;
      setting.slope_deg = slope;
      setting.restitution = {0.3, sd};
      setting.friction = {0.45, sd};
      setting.initial_speed = {4, sd};
      const Metastability found = study(setting, brief_sampled);
      double mean = 0, square = 0;
      constexpr int trials = 1000;
      const dynamics::WheelMap map = setting.map();
      for (int t = 0; t < trials; ++t) {
        const auto steps = static_cast<double>(
            dynamics::steps_to_rest(map, setting.launch(), 0, 5, static_cast<std::uint64_t>(t), most_simulated));
        mean += steps / trials, square += steps * steps / trials;
      }
      const double error = std::sqrt(std::max(0.0, square - mean * mean) / trials);
      EXPECT_LE(found.steps.from_start.lower, mean + 4 * error + 1e-9) << setting.describe();
      EXPECT_GE(found.steps.from_start.upper, mean - 4 * error - 1e-9) << setting.describe();
    }
}

TEST(FollowedStudy, ASmoothSlopeOfTheRoughTerrainWheel) {
  for (const double slope : {0.5, 1.5, 2.0, 4.0, 8.0}) {
    const dynamics::RoughTerrainWheel wheel({.mean_slope_rad = slope * in_radians, .sd_slope_rad = 0});
    int steps = 0;
    double x = 30;
    for (; x > 0 && steps < 500; ++steps) x = wheel.next(x, slope * in_radians);
    const Metastability found = study({wheel, {[](double) { return 30.0; }, 0}}, brief_integrated);
    if (steps == 500) {
      EXPECT_EQ(found.status, Status::rest_unreachable);
      EXPECT_NEAR(found.survivors.mean, wheel.fixed_point(), 1e-9);
    } else {
      EXPECT_EQ(found.steps.from_start.value, steps) << slope;
    }
  }
}

// The logistic map has a fixed point, a cycle of two, and no cycle that is short.
struct Logistic {
  double rate;
  std::pair<double, double> state_interval(int) const { return {0, 1}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 0; }
  std::optional<double> landing(double x, int, std::span<const double>) const { return rate * x * (1 - x); }
};

TEST(FollowedStudy, CyclesOfSeveralRevolutionsAreFound) {
  const auto of = [](double rate) { return study({Logistic{rate}, {[](double) { return 0.3; }, 0}}, brief_sampled); };
  EXPECT_NEAR(of(2.5).survivors.mean, 0.6, 1e-12);
  const Metastability two = of(3.2);
  EXPECT_EQ(two.status, Status::rest_unreachable);
  EXPECT_NEAR(two.survivors.mean, (3.2 + 1) / (2 * 3.2), 1e-9);  // mean of the two, in closed form
  EXPECT_GT(two.survivors.sd, 0.1);
  EXPECT_EQ(of(3.9).status, Status::rest_unresolved);
}

}  // namespace
}  // namespace metastable::analysis
