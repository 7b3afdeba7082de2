#include "analysis/experiment/stance_check.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/experiment/stand_in.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

using Rows = std::vector<MeasuredCollision>;

Experiment rolled(dynamics::Law law) {
  Setting setting = paper_setting(9.59, false);
  setting.law = law;
  setting.restitution = {0.54, 0.045};
  setting.friction = {0.352, 0.043};
  return parse_experiment(
      source_of(experiment_files(setting, simulate_trials(setting, {.trials = 20, .seed = 3}), "t", {}), ""));
}

Experiment spoilt(const std::function<void(Rows&)>& spoil, dynamics::Law law = dynamics::Law::published) {
  Experiment experiment = rolled(law);
  for (MeasuredTrial& trial : experiment.trials) spoil(trial.collisions);
  return experiment;
}

std::string refusal(const Experiment& experiment) {
  Defects defects;
  check_stances(experiment, "collisions.csv", defects);
  try {
    defects.check();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string question(const Experiment& experiment) {
  const std::vector<std::string> all = questions_on_stances(experiment);
  EXPECT_LE(all.size(), 1u);
  return all.empty() ? "" : all.front();
}

void scale(Rows& rows, double speeds, double times) {
  for (MeasuredCollision& c : rows) {
    c.omega_minus *= speeds;
    if (c.omega_plus) *c.omega_plus *= speeds;
    *c.time *= times;
  }
}

TEST(StanceCheck, TakesWhatWheelsDo) {
  for (const dynamics::Law law :
       {dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::plastic, dynamics::Law::settled}) {
    EXPECT_EQ(refusal(rolled(law)), "") << static_cast<int>(law);
    EXPECT_EQ(question(rolled(law)), "") << static_cast<int>(law);
  }
}

// It was diagnosed as a friction or a restitution that depends on speed, and expected steps came out 1000 times off.
TEST(StanceCheck, SuspectsSpeedsAfterThatStandARowOff) {
  const std::string early = refusal(spoilt([](Rows& rows) {
    for (std::size_t k = 0; k + 1 < rows.size(); ++k) rows[k].omega_plus = rows[k + 1].omega_plus;
    rows.back().omega_plus.reset();
  }));
  EXPECT_NE(early.find("omega_plus_rad_s: its values are suspected to stand one row early"), std::string::npos)
      << early;
  const std::string late = refusal(spoilt([](Rows& rows) {
    for (std::size_t k = rows.size() - 1; k > 0; --k) rows[k].omega_plus = rows[k - 1].omega_plus;
    rows.front().omega_plus.reset();
  }));
  EXPECT_NE(late.find("one row late"), std::string::npos) << late;
}

// Stances on ramps of other slopes, and over legs of other lengths, gain another energy by themselves.
TEST(StanceCheck, ComparesStancesOfOneRampAndOneLeg) {
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(stand_in_setting());
  const auto stand_in = [&](const LaboratoryOptions& reality) {
    const dynamics::LaboratorySetup setup = laboratory_setup(conditions, reality);
    const ExperimentFiles files = laboratory_files(conditions, setup, run_laboratory(setup, 0), {}).files;
    return parse_experiment({"lab", files.experiment_toml, files.collisions_csv, files.trials_csv, {}});
  };
  Experiment late = stand_in({.sensor_noise = 0.008, .seed = 3});
  EXPECT_EQ(refusal(late), "");
  for (MeasuredTrial& trial : late.trials)
    for (std::size_t k = trial.collisions.size() - 1; k > 0; --k)
      trial.collisions[k].omega_plus = trial.collisions[k - 1].omega_plus;
  EXPECT_NE(refusal(late).find("one row late"), std::string::npos);
  Setting odd = paper_setting(25, false);
  odd.law = dynamics::Law::coulomb;
  odd.wheel.leg_length = {0.15, 0.17, 0.16, 0.155, 0.165};
  odd.restitution = {0.2, 0.02};
  odd.friction = {0.8, 0.05};
  odd.ramp_length = 100;
  odd.initial_speed = {8, 0.3};
  const Experiment unequal =
      parse_experiment(source_of(experiment_files(odd, simulate_trials(odd, {.trials = 20, .seed = 3}), "t", {}), ""));
  EXPECT_EQ(refusal(unequal), "");
}

// A frame rate stated at twice its value doubles speeds and halves times, which agree: gravity tells.
TEST(StanceCheck, RefusesSpeedsThatGravityDoesNotGive) {
  const std::string doubled = refusal(spoilt([](Rows& rows) { scale(rows, 2, 0.5); }));
  EXPECT_NE(doubled.find("speeds 2 times too large are suspected"), std::string::npos) << doubled;
  EXPECT_EQ(refusal(spoilt([](Rows& rows) { scale(rows, 1.1, 1 / 1.1); })), "");
  const std::string more = question(spoilt([](Rows& rows) { scale(rows, 1.3, 1 / 1.3); }));
  EXPECT_NE(more.find("gives this wheel on the stated slope, or more: "), std::string::npos) << more;
  Experiment percent = rolled(dynamics::Law::published);
  percent.conditions[0].slope_deg = 16.9;
  EXPECT_NE(question(percent).find("gives this wheel on the stated slope, or less: "), std::string::npos)
      << question(percent);
}

// An inertia that is off was named with probability 1.
TEST(StanceCheck, AsksAboutSpeedsAndTimesThatContradictEachOther) {
  for (const double by : {0.9, 0.95, 1.05, 1.1}) {
    const std::string speeds = question(spoilt([&](Rows& rows) { scale(rows, by, 1); }));
    EXPECT_NE(speeds.find("contradict each other"), std::string::npos) << by << ' ' << speeds;
  }
  EXPECT_NE(question(spoilt([](Rows& rows) { scale(rows, 1, 2); })).find("contradict each other"), std::string::npos);
  EXPECT_EQ(question(spoilt([](Rows& rows) { scale(rows, 1.05, 1 / 1.05); })), "");
}

// The paper's three conditions in the virtual laboratory, with some trials each.
Experiment three_conditions(dynamics::Law law, int trials) {
  Setting setting = stand_in_setting();
  setting.law = law;
  if (law == dynamics::Law::settled) {
    setting.restitution = {0.4, 0.05};
    setting.friction = {0.4, 0.03};
    setting.wheel.radius_of_gyration = 0.0424;
  }
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(setting);
  for (LaboratoryCondition& one : conditions) one.trials = trials;
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, {.sensor_noise = 0.003, .seed = 3});
  const ExperimentFiles files = laboratory_files(conditions, setup, run_laboratory(setup, 0), {}).files;
  return parse_experiment({"lab", files.experiment_toml, files.collisions_csv, files.trials_csv, {}});
}

Experiment scaled(Experiment experiment, std::size_t condition, double speeds, double times) {
  for (MeasuredTrial& trial : experiment.trials)
    if (trial.condition == condition) scale(trial.collisions, speeds, times);
  return experiment;
}

// The middle of all rows does not show what one condition has wrong.
TEST(StanceCheck, JudgesConditionsByThemselves) {
  for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::settled}) {
    const Experiment right = three_conditions(law, 8);
    EXPECT_EQ(refusal(right), "");
    EXPECT_EQ(question(right), "");
    for (std::size_t c = 0; c < right.conditions.size(); ++c) {
      const std::string id = "'" + right.conditions[c].id + "'";
      const std::string doubled = refusal(scaled(right, c, 2, 0.5));
      EXPECT_NE(doubled.find("half of the stances of condition " + id), std::string::npos) << doubled;
      const std::string asked = question(scaled(right, c, 1.05, 1));
      EXPECT_NE(asked.find("contradict each other"), std::string::npos) << id;
      EXPECT_NE(asked.find("condition " + id), std::string::npos) << asked;
    }
    EXPECT_NE(question(scaled(right, 2, 0.95, 1)).find("contradict each other"), std::string::npos);
  }
}

TEST(StanceCheck, JudgesTrialsByThemselves) {
  for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::settled})
    for (const std::size_t from : {4u, 8u}) {
      Experiment changed = three_conditions(law, 12);
      for (std::size_t t = from; t < 12; ++t) scale(changed.trials[t].collisions, 1.05, 1);
      EXPECT_NE(question(changed).find("contradict each other"), std::string::npos) << from;
    }
}

TEST(StanceCheck, AsksAboutClocksThatJump) {
  Experiment experiment = rolled(dynamics::Law::published);
  for (std::size_t k = 4; k < experiment.trials[2].collisions.size(); ++k)
    *experiment.trials[2].collisions[k].time += 10;
  const std::string asked = question(experiment);
  EXPECT_NE(asked.find("1 of "), std::string::npos) << asked;
  EXPECT_NE(asked.find("before collision 5 of trial 3: does the clock jump"), std::string::npos) << asked;
}

// Trials with a collision that nobody noted were explained by noise of the sensor.
TEST(StanceCheck, AsksAboutCollisionsThatAreMissing) {
  Experiment experiment = rolled(dynamics::Law::published);
  Rows& rows = experiment.trials[1].collisions;
  rows.erase(rows.begin() + 6);
  for (std::size_t k = 0; k < rows.size(); ++k) rows[k].number = static_cast<int>(k) + 1;
  EXPECT_NE(question(experiment).find("before collision 7 of trial 2: is a collision missing?"), std::string::npos);
  for (MeasuredTrial& trial : experiment.trials)
    for (MeasuredCollision& c : trial.collisions) c.position.reset();
  EXPECT_NE(question(experiment).find("before collision 7 of trial 2: does the clock jump"), std::string::npos);
}

}  // namespace
}  // namespace metastable::analysis
