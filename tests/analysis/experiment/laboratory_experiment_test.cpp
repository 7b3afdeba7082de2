#include "analysis/experiment/laboratory_experiment.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/motion_capture/angle_file.h"
#include "analysis/motion_capture/collision_finder.h"
#include "tests/analysis/same_trials.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

std::vector<LaboratoryCondition> six_of_each() {
  auto conditions = stand_in_conditions(stand_in_setting());
  for (LaboratoryCondition& c : conditions) c.trials = 6;
  return conditions;
}

LaboratoryFiles make(LaboratoryOptions reality, FolderOptions folder) {
  const auto conditions = six_of_each();
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, reality);
  return laboratory_files(conditions, setup, run_laboratory(setup, reality.threads), folder);
}

Experiment read(const LaboratoryFiles& made) {
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
  // When shuffled, conditions take turns.
  int turns = 0;
  for (std::size_t t = 1; t < experiment.trials.size(); ++t)
    turns += experiment.trials[t].condition != experiment.trials[t - 1].condition;
  EXPECT_GT(turns, 4);
}

void expect_same(const Experiment& a, const Experiment& b) {
  EXPECT_EQ(a.title, b.title);
  EXPECT_EQ(a.system, b.system);
  EXPECT_EQ(a.wheel.leg_length, b.wheel.leg_length);
  EXPECT_EQ(a.wheel.hub_mass, b.wheel.hub_mass);
  EXPECT_EQ(a.wheel.inertia, b.wheel.inertia);
  EXPECT_EQ(a.wheel.radius_of_gyration, b.wheel.radius_of_gyration);
  EXPECT_EQ(a.wheel.contact_mass, b.wheel.contact_mass);
  EXPECT_EQ(a.wheel.ramp_stiffness, b.wheel.ramp_stiffness);
  EXPECT_EQ(a.wheel.gravity, b.wheel.gravity);
  EXPECT_EQ(a.contact.law, b.contact.law);
  const auto same = [](const Spread& x, const Spread& y) { return x.mean == y.mean && x.sd == y.sd; };
  EXPECT_TRUE(same(a.contact.restitution, b.contact.restitution));
  EXPECT_TRUE(same(a.contact.friction, b.contact.friction));
  EXPECT_EQ(a.sensor.rate, b.sensor.rate);
  EXPECT_EQ(a.sensor.noise_sd, b.sensor.noise_sd);
  EXPECT_EQ(a.notes, b.notes);
  EXPECT_EQ(a.columns.leg, b.columns.leg);
  EXPECT_EQ(a.columns.time, b.columns.time);
  EXPECT_EQ(a.columns.position, b.columns.position);
  EXPECT_EQ(a.columns.omega_plus, b.columns.omega_plus);
  EXPECT_EQ(a.columns.outcomes, b.columns.outcomes);
  ASSERT_EQ(a.conditions.size(), b.conditions.size());
  for (std::size_t c = 0; c < a.conditions.size(); ++c) {
    const Condition &x = a.conditions[c], &y = b.conditions[c];
    EXPECT_EQ(x.id, y.id);
    EXPECT_EQ(x.slope_deg, y.slope_deg);
    EXPECT_EQ(x.ramp_length, y.ramp_length);
    EXPECT_EQ(x.first_landing_leg, y.first_landing_leg);
    ASSERT_EQ(x.initial_speed.has_value(), y.initial_speed.has_value());
    EXPECT_TRUE(!x.initial_speed || same(*x.initial_speed, *y.initial_speed));
  }
  metastable::test::expect_same_trials(a, b);
}

// They agree, with the digits of the files, for every subset of what may be left unsaid and for laws with a gyration.
TEST(Reality, ExperimentInMemoryIsTheOneReadBackFromItsFiles) {
  for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::coulomb})
    for (std::size_t subset = 0; subset < std::size_t{1} << droppable().size();
         subset += law == dynamics::Law::published ? 1 : 37) {
      auto conditions = six_of_each();
      for (LaboratoryCondition& c : conditions) {
        c.setting.law = law;
        c.trials = 2;
        c.setting.first_landing_leg = 3;
      }
      FolderOptions folder{.title = "in \"memory\"", .restitution = Spread{0.5, 0.07}};
      for (std::size_t k = 0; k < droppable().size(); ++k)
        if (subset >> k & 1) folder.dropped.push_back(droppable()[k]);
      if (subset % 3 == 0) folder.camera = CameraOptions{};
      const dynamics::LaboratorySetup setup =
          laboratory_setup(conditions, {.sensor_noise = 0.01, .shuffled = true, .seed = subset + 1});
      const auto run = run_laboratory(setup, 1);
      expect_same(experiment_of(conditions, setup, run, folder),
                  read(laboratory_files(conditions, setup, run, folder)));
    }
}

TEST(Reality, WhatIsDroppedIsNotTold) {
  const LaboratoryFiles made = make(
      {}, {.dropped = {"leg", "time_s", "position_m", "omega_plus_rad_s", "outcome", "initial_speed_rad_s", "noise"}});
  EXPECT_TRUE(made.files.collisions_csv.starts_with("condition,trial,collision,omega_minus_rad_s\n"));
  const Experiment experiment = read(made);
  EXPECT_EQ(experiment.columns.leg, Presence::none);
  EXPECT_EQ(experiment.columns.time, Presence::none);
  EXPECT_FALSE(experiment.columns.outcomes);
  EXPECT_FALSE(experiment.sensor.noise_sd);
  EXPECT_FALSE(experiment.conditions[0].initial_speed);
  EXPECT_TRUE(message_of([&] { make({}, {.dropped = {"legs"}}); }).starts_with("drop: 'legs' is none of leg, time_s"));
}

TEST(Reality, SameSeedSameBytesOnAnyNumberOfThreads) {
  const LaboratoryOptions one{.sensor_noise = 0.01, .shuffled = true, .seed = 5, .threads = 1};
  LaboratoryOptions two = one;
  two.threads = 2;
  const LaboratoryFiles a = make(one, {.camera = CameraOptions{}}), b = make(two, {.camera = CameraOptions{}});
  EXPECT_EQ(a.files.collisions_csv, b.files.collisions_csv);
  EXPECT_EQ(a.angle_csv, b.angle_csv);
  two.seed = 6;
  EXPECT_NE(make(two, {}).files.collisions_csv, a.files.collisions_csv);
}

// Follows the camera's way to the speeds: angle.csv through the finder of collisions, against the true ones.
TEST(Reality, CollisionsFoundInTheAngleAreTheTrueOnes) {
  const LaboratoryFiles made = make({}, {.camera = CameraOptions{}});
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
  conditions[0].setting.law = dynamics::Law::settled;
  FolderOptions filmed;
  filmed.camera = CameraOptions{};
  EXPECT_THROW(laboratory_files(conditions, laboratory_setup(conditions, {}), {}, filmed), std::invalid_argument);
  EXPECT_THROW(angle_csv({{"settled", conditions[0].setting, {}}}, {}), std::invalid_argument);
  conditions[0].setting.law = dynamics::Law::published;
  EXPECT_THROW(laboratory_setup({}, {}), std::invalid_argument);
  EXPECT_THROW(laboratory_files({}, {}, {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis::test
