#include "analysis/wheel_model/leg_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/experiment/stand_in.h"
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

// Trials of a wheel whose feet hop, in the virtual laboratory; some landings are too fast to be judged.
Experiment hopping_wheel() {
  Setting setting = stand_in_setting();
  setting.law = dynamics::Law::settled;
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.4, 0.03};
  setting.wheel.radius_of_gyration = 0.0424;
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(setting);
  conditions.resize(1);
  conditions[0].trials = 16;
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, {.sensor_noise = 0.003, .seed = 3});
  return experiment_of(conditions, setup, run_laboratory(setup, 0), {});
}

// The effects leg_lengths and, of columns a row off, leg_contact were named, or nothing was.
TEST(LegOrder, IsJudgedByHowLandingsGoOnUnderSettled) {
  const Experiment e = hopping_wheel();
  const WheelRuns right = wheel_runs(e);
  for (const std::string& note : right.notes) EXPECT_FALSE(note.ends_with('?')) << note;
  const auto turned = [&](std::size_t trials, int by) {
    WheelRuns runs = right;
    for (std::size_t t = 0; t < trials; ++t)
      for (RunCollision& m : runs.runs[t].collisions) m.context.leg = (m.context.leg + by) % 8;
    return question_on_leg_order(runs, e).value_or("");
  };
  EXPECT_NE(turned(16, 1).find("leg 0 has length 7 of that list (counted from 0), leg 1 length 0"), std::string::npos);
  EXPECT_NE(turned(16, 7).find("leg 0 has length 1 of that list (counted from 0), leg 1 length 2"), std::string::npos);
  EXPECT_NE(turned(5, 1).find(" of 16 trials, the first of them trial "), std::string::npos) << turned(5, 1);
  WheelRuns late = right, early = right;
  for (WheelRun& run : late.runs)
    for (std::size_t k = run.collisions.size() - 1; k > 0; --k) run.collisions[k].after = run.collisions[k - 1].after;
  for (WheelRun& run : early.runs)
    for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) run.collisions[k].after = run.collisions[k + 1].after;
  EXPECT_TRUE(question_on_rows(late).value_or("").ends_with("does the column stand a row late?"));
  EXPECT_TRUE(question_on_rows(early).value_or("").ends_with("does the column stand a row early?"));
}

}  // namespace
}  // namespace metastable::analysis
