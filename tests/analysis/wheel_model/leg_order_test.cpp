#include "analysis/wheel_model/leg_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "analysis/experiment/experiment_folder.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

// Trials of the paper's wheel, with a sensor's noise [rad/s] on every speed.
Experiment noisy_wheel(double noise, dynamics::Law law = dynamics::Law::published) {
  Setting setting = paper_setting(9.59, false);
  setting.law = law;
  setting.restitution = {0.54, 0.045};
  setting.friction = {0.352, 0.043};
  Experiment e = parse_experiment(
      source_of(experiment_files(setting, simulate_trials(setting, {.trials = 40, .seed = 4}), "t", {}), ""));
  std::mt19937_64 bits(7);
  std::normal_distribution<double> error(0, noise);
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) {
      c.omega_minus += error(bits);
      if (*c.omega_plus > 0) *c.omega_plus += error(bits);
    }
  e.sensor = {.rate = {}, .noise_sd = noise, .last_digit = 1e-6};
  return e;
}

void turn(MeasuredTrial& trial, int by) {
  for (MeasuredCollision& c : trial.collisions) c.leg = (*c.leg + by) % 8;
}

std::string asked(const Experiment& e) {
  for (const std::string& note : wheel_runs(e).notes)
    if (note.starts_with("leg:")) return note;
  return "";
}

TEST(LegOrder, IsNotAskedAboutWhereTheColumnIsRight) {
  for (const double noise : {0.0, 0.008, 0.05}) EXPECT_EQ(asked(noisy_wheel(noise)), "") << noise;
  EXPECT_EQ(asked(noisy_wheel(0.008, dynamics::Law::coulomb)), "");
}

// The effect leg_lengths closed all of the gap, and was named with probability 1.
TEST(LegOrder, IsAskedAboutWhereTheColumnIsOff) {
  for (const double noise : {0.008, 0.03}) {
    Experiment e = noisy_wheel(noise);
    for (MeasuredTrial& trial : e.trials) turn(trial, 1);
    const std::string question = asked(e);
    EXPECT_NE(question.find("the foot noted as leg 0 has length 7 of that list (counted from 0), leg 1 length 0"),
              std::string::npos)
        << question;
    EXPECT_TRUE(question.ends_with("turned on by some legs?")) << question;
  }
}

TEST(LegOrder, IsAskedAboutWhereTheListRunsBackwards) {
  Experiment e = noisy_wheel(0.008);
  std::ranges::reverse(e.wheel.leg_length);
  const std::string question = asked(e);
  EXPECT_NE(question.find("the foot noted as leg 0 has length 7 of that list (counted from 0), leg 1 length 6"),
            std::string::npos)
      << question;
  EXPECT_TRUE(question.ends_with("in which the legs land?")) << question;
}

TEST(LegOrder, IsAskedAboutOfSomeTrials) {
  Experiment e = noisy_wheel(0.008);
  for (const std::size_t t : {3u, 7u, 20u}) turn(e.trials[t], 3);
  EXPECT_NE(asked(e).find("the stances of 3 of 40 trials, the first of them trial 4"), std::string::npos) << asked(e);
}

// Legs whose lengths are truly other ones are an effect, not an order.
TEST(LegOrder, IsNotAskedAboutWhereALegIsLonger) {
  for (const std::size_t leg : {0u, 2u, 5u, 7u})
    for (const double by : {-0.002, -0.0005, 0.0005, 0.002}) {
      Experiment e = noisy_wheel(0.008);
      e.wheel.leg_length[leg] += by;
      EXPECT_EQ(asked(e), "") << leg << ' ' << by;
    }
}

}  // namespace
}  // namespace metastable::analysis
