#include "analysis/experiment/reality.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/motion_capture/angle_file.h"
#include "analysis/motion_capture/collision_finder.h"

namespace metastable::analysis::test {
namespace {

RealityFiles make(RealityOptions reality, FolderOptions folder) {
  auto conditions = stand_in_conditions(stand_in_setting());
  for (RealityCondition& c : conditions) c.trials = 6;
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, reality);
  return reality_files(conditions, setup, run_laboratory(setup, reality.threads), folder);
}

Experiment read(const RealityFiles& made) {
  ExperimentSource source = source_of(made.files, "lab");
  source.angle_csv = made.angle_csv;
  return parse_experiment(source);
}

TEST(Reality, FolderIsReadBackByTheStrictReader) {
  const Experiment experiment =
      read(make({.sensor_noise = 0.01, .shuffled = true}, {.title = "lab", .camera = CameraOptions{}}));
  EXPECT_EQ(experiment.trials.size(), 18U);
  EXPECT_EQ(experiment.conditions.size(), 3U);
  EXPECT_EQ(experiment.columns.leg, Presence::all);
  EXPECT_EQ(experiment.columns.omega_plus, Presence::all);
  EXPECT_TRUE(experiment.columns.outcomes);
  EXPECT_EQ(experiment.sensor.noise_sd, 0.01);
  // Shuffled: conditions take turns.
  int turns = 0;
  for (std::size_t t = 1; t < experiment.trials.size(); ++t)
    turns += experiment.trials[t].condition != experiment.trials[t - 1].condition;
  EXPECT_GT(turns, 4);
}

TEST(Reality, WhatIsDroppedIsNotTold) {
  const RealityFiles made = make(
      {}, {.dropped = {"leg", "time_s", "position_m", "omega_plus_rad_s", "outcome", "initial_speed_rad_s", "noise"}});
  EXPECT_TRUE(made.files.collisions_csv.starts_with("condition,trial,collision,omega_minus_rad_s\n"));
  const Experiment experiment = read(made);
  EXPECT_EQ(experiment.columns.leg, Presence::none);
  EXPECT_EQ(experiment.columns.time, Presence::none);
  EXPECT_FALSE(experiment.columns.outcomes);
  EXPECT_FALSE(experiment.sensor.noise_sd);
  EXPECT_FALSE(experiment.conditions[0].initial_speed);
  try {
    make({}, {.dropped = {"legs"}});
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_TRUE(std::string(error.what()).starts_with("drop: \"legs\" is none of leg, time_s")) << error.what();
  }
}

TEST(Reality, SameSeedSameBytesOnAnyNumberOfThreads) {
  const RealityOptions one{.sensor_noise = 0.01, .shuffled = true, .seed = 5, .threads = 1};
  RealityOptions two = one;
  two.threads = 2;
  const RealityFiles a = make(one, {.camera = CameraOptions{}}), b = make(two, {.camera = CameraOptions{}});
  EXPECT_EQ(a.files.collisions_csv, b.files.collisions_csv);
  EXPECT_EQ(a.angle_csv, b.angle_csv);
  two.seed = 6;
  EXPECT_NE(make(two, {}).files.collisions_csv, a.files.collisions_csv);
}

// The camera's way to the speeds: angle.csv through the finder of collisions, against the true ones.
TEST(Reality, CollisionsFoundInTheAngleAreTheTrueOnes) {
  const RealityFiles made = make({}, {.camera = CameraOptions{}});
  const Experiment truth = read(made);
  ExperimentSource source = source_of(made.files, "lab");
  source.collisions_csv.reset();
  source.angle_csv = made.angle_csv;
  const Experiment description = parse_description(source);
  std::size_t compared = 0;
  for (const MeasuredAngle& angle : parse_angles(source, description)) {
    const MeasuredTrial& trial = truth.trials[static_cast<std::size_t>(angle.number - 1)];
    const FoundTrial found = find_collisions(angle.recording, nominal_setting(truth, trial.condition).map(), 0, {});
    ASSERT_EQ(found.collisions.size(), trial.collisions.size());
    for (std::size_t k = 0; k < found.collisions.size(); ++k)
      if (found.collisions[k].fit) {
        EXPECT_NEAR(found.collisions[k].fit->omega_minus, trial.collisions[k].omega_minus, 0.015);  // six sd
        ++compared;
      }
  }
  EXPECT_GT(compared, truth.collisions() * 9 / 10);
}

TEST(Reality, RefusesWhatTheLaboratoryDoesNotHave) {
  auto conditions = stand_in_conditions(stand_in_setting());
  conditions[0].setting.correlation = 0.3;
  EXPECT_THROW(laboratory_setup(conditions, {}), std::invalid_argument);
  conditions[0].setting.correlation = 0;
  EXPECT_THROW(laboratory_setup(conditions, {.collisions = 0}), std::invalid_argument);
  EXPECT_THROW(laboratory_setup({}, {}), std::invalid_argument);
  EXPECT_THROW(reality_files({}, {}, {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis::test
