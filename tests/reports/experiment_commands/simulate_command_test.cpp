// What `metastable simulate` writes, and what it refuses.

#include "reports/experiment_commands/simulate_command.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using SimulateCommand = CommandLine;

TEST_F(SimulateCommand, WritesAnExperimentOnce) {
  const std::vector<std::string> words{"simulate", "--trials", "5", "--out", path("trials")};
  const Ran ran = metastable(words);
  ASSERT_EQ(ran.code, 0) << ran.err;
  for (const char* name : {"experiment.toml", "collisions.csv", "trials.csv"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "trials" / name)) << name;
  const Ran again = metastable(words);
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("already holds"), std::string::npos);
}

TEST_F(SimulateCommand, LaunchesAreSteadyWhereThePaperHasNone) {
  const Ran ran = metastable({"simulate", "--slope", "8", "--legs", "0.1519", "--trials", "3", "--out", path("t")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(read(path("t/experiment.toml")).find("initial_speed_rad_s = { mean = 4."), std::string::npos)
      << read(path("t/experiment.toml"));
}

// On 18 deg a rigid wheel takes off: such trials are none of an experiment folder, which the reader would refuse.
TEST_F(SimulateCommand, WheelsThatFlyOverALegAreNotWritten) {
  for (const bool reality : {false, true}) {
    std::vector<std::string> words{"simulate", "--law",    "settled", "--slope", "18",     "--initial-speed",
                                   "8,0.5",    "--trials", "20",      "--out",   path("t")};
    if (reality) words.emplace_back("--reality");
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 3);
    EXPECT_NE(ran.err.find("nothing was written: no reader of experiment folders takes these trials"),
              std::string::npos)
        << ran.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "t"));
  }
}

// What it understands gives the same trials on one thread and on two.
TEST_F(SimulateCommand, RealityLeavesNothingBehindWhenItIsMisunderstood) {
  const auto refused = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "simulate");
    words.insert(words.end(), {"--out", path("lab")});
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 2);
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1);
    return ran.err;
  };
  EXPECT_EQ(refused({"--effect", "bounce"}), "metastable: --effect: needs --reality\n");
  EXPECT_EQ(refused({"--reality", "--effect", "inertia:ratio=9"}),
            "metastable: effect inertia: ratio: 9 is outside [0.5, 2]\n");
  EXPECT_EQ(
      refused({"--reality", "--effect", "bounce"}),
      "metastable: effect bounce: does nothing without rebound_lost; it takes rebound_lost in [0, 1], onset_rad_s in "
      "[0, 50] rad/s, written bounce:rebound_lost=VALUE,onset_rad_s=VALUE\n");
  EXPECT_EQ(refused({"--reality", "--outside", "planks"}),
            "metastable: --outside: 'planks' is not of the form ID:SIZE\n");
  EXPECT_EQ(refused({"--reality", "--outside", "planks:7"}), "metastable: effect planks: size 7 is outside [0, 0.9]\n");
  const auto walker = [&](const char* name, std::vector<std::string> words) {
    words.insert(words.begin(), {"--walker", name, "--slope-sd", "0.1"});
    return refused(words);
  };
  const std::string damping =
      "metastable: effect hip_damping: does nothing without damping; it takes damping in [0, 5] N "
      "m s/rad, written hip_damping:damping=VALUE\n";
  EXPECT_EQ(walker("compass", {"--effect", "hip_damping"}), damping);
  EXPECT_EQ(walker("compass", {"--reality", "--effect", "hip_damping"}), damping);
  EXPECT_EQ(walker("compass", {"--reality", "--collisions", "1"}),
            "metastable: --collisions: 1 is outside 2..1000000\n");
  EXPECT_EQ(walker("simplest", {"--effect", "hip_damping:damping=3"}),
            "metastable: effect hip_damping: damping: 3 is outside [0, 2]\n");
  EXPECT_EQ(walker("simplest", {"--effect", "leg_mass:higher=0.1"}),
            "metastable: --effect: 'leg_mass' is none of hip_damping, hip_dry_friction, impact_loss, foot_slip, "
            "launch_half_angle_rad, launch_stance_rate_rad_s, launch_spread_half_angle_rad, "
            "launch_spread_stance_rate_rad_s\n");
  EXPECT_TRUE(left_behind().empty());
  const std::vector<std::string> fine{"simulate",          "--reality", "--effect",
                                      "inertia:ratio=1.1", "--effect",  "leg_contact:leg=3,friction_ratio=1.4",
                                      "--trials",          "3",         "--out"};
  std::vector<std::string> one = fine, two = fine;
  one.push_back(path("one")), two.push_back(path("two"));
  two.insert(two.end(), {"--threads", "2"});
  EXPECT_EQ(metastable(one).code, 0);
  EXPECT_EQ(metastable(two).code, 0);
  EXPECT_EQ(read(folder_ / "one" / "collisions.csv"), read(folder_ / "two" / "collisions.csv"));
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(SimulateCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"simulate"}, "--out: a folder must be given"},
      {{"simulate", "--trials", "0", "--out", path("t")}, "--trials: 0 is outside 1..1000000"},
  });
}

}  // namespace
}  // namespace metastable::reports::test
