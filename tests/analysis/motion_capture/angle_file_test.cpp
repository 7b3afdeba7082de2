#include "analysis/motion_capture/angle_file.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/input_error.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

using Strings = std::vector<std::string>;

const std::string description =
    "[wheel]\nhub_mass_kg = 1.39\nleg_lengths_m = [0.15, 0.15, 0.15]\n[contact]\nlaw = \"plastic\"\n[[condition]]\nid "
    "= \"a\"\n"
    "slope_deg = 9\nramp_length_m = 3\n";

Strings defects(const std::string& angles, std::optional<std::string> trials = {}) {
  const ExperimentSource source{.folder = "",
                                .experiment_toml = description,
                                .collisions_csv = {},
                                .trials_csv = std::move(trials),
                                .angle_csv = angles};
  try {
    parse_angles(source, parse_description(source));
  } catch (const InputError& error) {
    return error.lines();
  }
  return {};
}

TEST(AngleFile, ReadsWhatSimulateWrites) {
  const Setting setting = paper_setting(9.59, false);
  const auto trials = simulate_trials(setting, {.trials = 5, .seed = 3});
  const ExperimentFiles files = experiment_files(setting, trials, "t", {});
  const CameraOptions camera{.rate = 250, .noise_sd_rad = 0, .seed = 1, .threads = 1};
  const ExperimentSource source{.folder = "",
                                .experiment_toml = files.experiment_toml,
                                .collisions_csv = {},
                                .trials_csv = files.trials_csv,
                                .angle_csv = angle_csv(setting, trials, camera)};
  const std::vector<MeasuredAngle> angles = parse_angles(source, parse_description(source));
  ASSERT_EQ(angles.size(), trials.size());
  for (std::size_t t = 0; t < angles.size(); ++t) {
    const AngleRecording recording = record_angle(setting.map(), trials[t], camera, t);
    ASSERT_EQ(angles[t].recording.time.size(), recording.time.size());
    EXPECT_NEAR(angles[t].recording.angle_rad.back(), recording.angle_rad.back(), 1e-8);
    EXPECT_LT(recording.time.front(), 0);
    EXPECT_GT(recording.time.back(), trials[t].collisions.back().time);
  }
}

TEST(AngleFile, RecordsTurnAtTheSpeedsOfTheTrial) {
  const Setting setting = paper_setting(9.59, false);
  const auto trials = simulate_trials(setting, {.trials = 1, .seed = 3});
  const AngleRecording r =
      record_angle(setting.map(), trials[0], {.rate = 20000, .noise_sd_rad = 0, .seed = 1, .threads = 1}, 0);
  for (const dynamics::TrialCollision& c : trials[0].collisions) {
    std::size_t i = 0;
    while (r.time[i] < c.time) ++i;
    const auto speed = [&](std::size_t k) {
      return (r.angle_rad[k + 1] - r.angle_rad[k]) / (r.time[k + 1] - r.time[k]);
    };
    EXPECT_NEAR(speed(i - 2), c.omega_minus, 0.01);
    EXPECT_NEAR(speed(i), c.omega_plus, 0.01);
  }
}

TEST(AngleFile, NamesWhatIsWrong) {
  const std::string header = "condition,trial,time_s,angle_rad\n";
  EXPECT_TRUE(defects(header + "a,1,0,0\na,1,0.01,0.1\n").empty());
  EXPECT_EQ(defects(header), (Strings{"angle.csv: holds no frame"}));
  EXPECT_EQ(defects(header + "a,1,0,0\n"), (Strings{"angle.csv:2:1: trial 1 has one frame only"}));
  EXPECT_EQ(defects(header + "a,1,0,0\na,1,0.01,0.1\na,1,0.01,0.2\na,1,0.02,0.3\n"),
            (Strings{"angle.csv:4:1: time_s: 0.01 s is not after the frame before (0.01 s)"}));
  EXPECT_EQ(
      defects(header + "a,1,0,0\na,1,0.01,0.1\na,1,0.02,0.2\na,1,0.04,0.3\n"),
      (Strings{
          "angle.csv:5:1: time_s: 0.02 s after the frame before where trial 1 has 0.01 s; frames must follow evenly"}));
  EXPECT_EQ(defects(header + "a,1,0,x\nb,1,0.01,0.1\n"),
            (Strings{"angle.csv:2:7: angle_rad: 'x' is not a finite number",
                     "angle.csv:3:1: condition: unknown condition 'b'; experiment.toml has: a"}));
  EXPECT_EQ(defects(header + "a,1,0,0\na,1,0.01,0.1\n", "trial,outcome\n2,rest\n"),
            (Strings{"angle.csv:2:1: trial 1 is not in trials.csv", "trials.csv:2:1: trial 2 is not in angle.csv"}));
}

}  // namespace
}  // namespace metastable::analysis
