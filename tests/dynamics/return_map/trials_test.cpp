#include "dynamics/return_map/trials.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

const TruncatedNormal launch_7(7.35, 0.19, 0);

struct Moments {
  double sum = 0, square = 0;
  int count = 0;
  void add(double x) {
    sum += x;
    square += x * x;
    ++count;
  }
  double mean() const { return sum / count; }
  double sd() const { return std::sqrt(square / count - mean() * mean()); }
  double error() const { return sd() / std::sqrt(count); }
};

Moments steps(const WheelMap& map, const TruncatedNormal& launch, int trials) {
  Moments m;
  for (int i = 0; i < trials; ++i)
    m.add(static_cast<double>(steps_to_rest(map, launch, 0, 7, static_cast<std::uint64_t>(i), 1000000)));
  return m;
}

WheelMap published(double slope, double friction, double sd) {
  return {even_wheel(), slope * degree, Law::published, ContactNoise::normal(0.4, 0.1, friction, sd)};
}

// metastable steps --legs 0.1519 --method integrated, with --slope 9.59 or --friction 0.3,0.05, gives 4.26, 6.17 and
// 1.30e3 steps; half a unit of the third digit is allowed for.
TEST(Trials, ExpectedStepsOfThePublishedLaw) {
  const Moments flat = steps(published(7.02, 0.4, 0.1), launch_7, 100000);
  EXPECT_NEAR(flat.mean(), 4.26, 4 * flat.error() + 0.005);
  const Moments steep = steps(published(9.59, 0.4, 0.1), TruncatedNormal(5.83, 0.28, 0), 100000);
  EXPECT_NEAR(steep.mean(), 6.17, 4 * steep.error() + 0.007);
}

TEST(Trials, ExpectedStepsOfRareFailures) {
  const Moments m = steps(published(7.02, 0.3, 0.05), launch_7, 1500);
  EXPECT_NEAR(m.mean(), 1.30e3, 4 * m.error() + 10);
}

TEST(Trials, ExpectedStepsOfTheCoulombLaw) {
  const WheelMap map(even_wheel(), 3 * degree, Law::coulomb, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  const Moments m = steps(map, TruncatedNormal(4.5, 0.2, 0), 40000);
  EXPECT_NEAR(m.mean(), 24.68, 4 * std::hypot(m.error(), 0.03));
}

// This is Fig. 8 as tests/analysis/paper/energy_losses_test.cpp reads it, to rounding and four standard errors.
TEST(Trials, EnergyLossesOfFigure8) {
  struct Row {
    int k;
    double tangential, tangential_sd, normal, normal_sd;
  };
  for (const Row& row : {Row{1, 0.066, 0.041, 0.164, 0.074}, Row{4, 0.103, 0.171, 0.141, 0.099}}) {
    const double sd = 0.05 * row.k;
    const WheelMap map(Wheel(), 7.02 * degree, Law::published, ContactNoise::normal(0.4, sd, 0.4, sd));
    TrialOptions options;
    options.rest_rule = false;
    options.ramp_length = std::numeric_limits<double>::infinity();
    Moments tangential, normal;
    for (std::uint64_t i = 0; i < 4000; ++i)
      for (const TrialCollision& c : simulate_trial(map, launch_7, options, i).collisions) {
        tangential.add(c.loss.tangential() - c.loss.potential);
        normal.add(c.loss.normal());
      }
    EXPECT_NEAR(tangential.mean(), row.tangential, 0.0005 + 8 * tangential.error());
    EXPECT_NEAR(tangential.sd(), row.tangential_sd, 0.003);
    EXPECT_NEAR(normal.mean(), row.normal, 0.0005 + 8 * normal.error());
    EXPECT_NEAR(normal.sd(), row.normal_sd, 0.002);
  }
}

TEST(Trials, AreTheSameBitsInAnyOrder) {
  const WheelMap map(Wheel(), 7.02 * degree, Law::published, ContactNoise::normal(0.4, 0.1, 0.35, 0.1));
  TrialOptions options;
  options.seed = 42;
  const auto run = [&](std::uint64_t i) { return simulate_trial(map, launch_7, options, i); };
  std::vector<Trial> forward, backward;
  for (std::uint64_t i = 0; i < 20; ++i) forward.push_back(run(i));
  for (std::uint64_t i = 20; i-- > 0;) backward.push_back(run(i));
  std::reverse(backward.begin(), backward.end());
  for (std::size_t i = 0; i < forward.size(); ++i) {
    ASSERT_EQ(forward[i].collisions.size(), backward[i].collisions.size());
    for (std::size_t k = 0; k < forward[i].collisions.size(); ++k) {
      EXPECT_EQ(forward[i].collisions[k].omega_minus, backward[i].collisions[k].omega_minus);
      EXPECT_EQ(forward[i].collisions[k].contact.friction, backward[i].collisions[k].contact.friction);
    }
  }
  EXPECT_NE(forward[0].collisions[0].omega_minus, forward[1].collisions[0].omega_minus);
}

TEST(Trials, CountersOfStepsAgreeWithWholeTrials) {
  const WheelMap map(Wheel(), 7.02 * degree, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  TrialOptions options;
  options.seed = 3;
  options.first_landing_leg = 5;
  options.max_collisions = 1000;
  options.ramp_length = std::numeric_limits<double>::infinity();
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Trial trial = simulate_trial(map, launch_7, options, i);
    ASSERT_EQ(trial.outcome, Outcome::rest);
    EXPECT_EQ(trial.collisions.size(), steps_to_rest(map, launch_7, 5, 3, i, 1000));
    EXPECT_EQ(trial.collisions.front().leg, 5);
  }
  EXPECT_EQ(steps_to_rest(map, launch_7, 0, 3, 0, 1), 1U);
}

TEST(Trials, FeetAndClockAdvance) {
  const WheelMap map(Wheel(), 9.59 * degree, Law::plastic, ContactNoise::normal(0, 0, 1, 0));
  TrialOptions options;
  options.max_collisions = 100;
  const Trial trial = simulate_trial(map, TruncatedNormal(5.83, 0, 0), options, 0);
  EXPECT_EQ(trial.outcome, Outcome::end_of_ramp);
  ASSERT_EQ(trial.collisions.size(), 32U);
  EXPECT_EQ(trial.collisions.front().position, 0);
  EXPECT_EQ(trial.collisions.front().time, 0);
  EXPECT_NEAR(trial.collisions.back().position, 3.604, 1e-3);
  EXPECT_EQ(trial.collisions[9].leg, 1);
  // It turns 45 deg a step, at speeds between the slowest (over the foot) and the fastest (before a collision).
  const double step = trial.collisions[20].time - trial.collisions[19].time;
  EXPECT_GT(step * 5.8, 45 * degree);
  EXPECT_LT(step * 3.8, 45 * degree);
}

TEST(Trials, LastCollisionOnTheRamp) {
  const WheelMap map(Wheel(), 9.59 * degree, Law::plastic, ContactNoise::normal(0, 0, 1, 0));
  EXPECT_EQ(last_collision_on_ramp(map, 0, 3.66), 32);
  EXPECT_EQ(last_collision_on_ramp(map, 0, 0), 1);
  EXPECT_EQ(last_collision_on_ramp(map, 0, std::numeric_limits<double>::infinity()), std::numeric_limits<int>::max());
  double position = 0;
  for (int n = 1; n < 40; ++n) {
    EXPECT_EQ(last_collision_on_ramp(map, 3, position + 1e-9), n);
    position += map.advance((3 + n - 1) % 8);
  }
}

TEST(Trials, OutcomesAtTheirLimits) {
  const WheelMap map(even_wheel(), 7.02 * degree, Law::plastic, ContactNoise::normal(0, 0, 1, 0));
  TrialOptions options;
  EXPECT_EQ(simulate_trial(map, TruncatedNormal(7, 0, 0), options, 0).outcome, Outcome::max_collisions);
  EXPECT_EQ(simulate_trial(map, TruncatedNormal(7, 0, 0), options, 0).collisions.size(), 16U);
  const Trial stopped = simulate_trial(map, TruncatedNormal(1, 0, 0), options, 0);
  EXPECT_EQ(stopped.outcome, Outcome::rest);
  EXPECT_EQ(stopped.collisions.size(), 1U);
  options.rest_rule = false;
  EXPECT_EQ(simulate_trial(map, TruncatedNormal(1, 0, 0), options, 0).outcome, Outcome::max_collisions);
}

TEST(Trials, IllegalInputIsNamed) {
  const WheelMap map(even_wheel(), 7.02 * degree, Law::plastic, ContactNoise::normal(0, 0, 1, 0));
  const auto message = [&](TrialOptions options) {
    return message_of([&] { simulate_trial(map, launch_7, options, 0); });
  };
  EXPECT_EQ(message({.max_collisions = 0}), "max_collisions: 0 is outside [1, inf)");
  EXPECT_EQ(message({.ramp_length = -1}), "ramp_length: -1 m is outside [0, inf]");
  EXPECT_EQ(message({.first_landing_leg = 8}), "first_landing_leg: 8 is outside [0, 7]");
  EXPECT_EQ(message_of([&] { steps_to_rest(map, launch_7, -1, 1, 0, 10); }), "first_landing_leg: -1 is outside [0, 7]");
}

// settled.md says: 28.9 (27.7 to 30.1) % of the trials rest before 3.66 m, at steady speeds about 4.8 rad/s.
TEST(Trials, SettledRestsAsItsOwnDirectSimulationSays) {
  Wheel wheel;
  wheel.radius_of_gyration = std::sqrt(0.0025 / wheel.hub_mass);
  const SettledMotion motion(settled_wheel(wheel, 7.02 * test::degree));
  const ContactNoise noise = ContactNoise::normal(0.4, 0.05, 0.4, 0.03, 0, most_settled_restitution);
  const TruncatedNormal launch(7.35, 0.19, 0);
  constexpr int trials = 400;
  int rests = 0, late = 0;
  double speed = 0;
  for (int k = 0; k < trials; ++k) {
    const Trial trial = simulate_trial(motion, noise, launch, {.max_collisions = 100, .ramp_length = 3.66}, k);
    ASSERT_NE(trial.outcome, Outcome::max_collisions);
    rests += trial.outcome == Outcome::rest;
    for (std::size_t c = 1; c < trial.collisions.size(); ++c)
      EXPECT_GT(trial.collisions[c].position, trial.collisions[c - 1].position + 0.1);
    for (std::size_t c = 12; c < trial.collisions.size(); ++c, ++late) speed += trial.collisions[c].omega_minus;
    if (k == 0) {
      EXPECT_EQ(steps_to_rest(motion, noise, launch, 0, 1, 0, trial.collisions.size()), trial.collisions.size());
    }
  }
  EXPECT_NEAR(rests, 0.289 * trials, 4.5 * std::sqrt(0.289 * 0.711 * trials));
  EXPECT_NEAR(speed / late, 4.8, 0.1);
}

}  // namespace
}  // namespace metastable::dynamics::test
