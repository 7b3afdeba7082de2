// Tests walkers on the command line: numbers with what stands beside them, files, and what is refused.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {

class WalkerCommand : public InFolder {};

std::vector<std::string> walker(const std::string& command, const std::vector<std::string>& more) {
  std::vector<std::string> words{command, "--walker", "simplest", "--slope-sd", "0.17"};  // 3e-3 rad: 5 steps
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(WalkerCommand, StepsSaysWhatStandsBehindThem) {
  const Ran ran = metastable(
      walker("steps", {"--spacing", "0.9", "--simulated-steps", "50000", "--how-it-fails", "--json", path("w.json")}));
  ASSERT_EQ(ran.code, 0) << ran.err;
  for (const char* said : {"expected steps before failure", "by direct simulation", "agreed", "0.200310901",
                           "-0.1901 ± 0.5576 i", "The most likely last steps", "the one that fails"})
    EXPECT_NE(ran.out.find(said), std::string::npos) << said << '\n' << ran.out;
  const auto json = nlohmann::json::parse(read(path("w.json")));
  EXPECT_EQ(json["status"], "agreed");
  const double low = json["expected_steps"]["interval_95"][0], high = json["expected_steps"]["interval_95"][1];
  const double simulated = json["direct_simulation"]["value"];
  EXPECT_LT(low, simulated * 1.02);
  EXPECT_GT(high, simulated * 0.98);
  EXPECT_NEAR(json["gait"]["eigenvalues"][0][0].get<double>(), -0.19010, 1e-4);
  EXPECT_NEAR(json["gait"]["state"][1].get<double>(), -0.199832473005, 1e-9);
  EXPECT_EQ(json["how_it_fails"]["by_phase"].size(), 1U);
  EXPECT_GT(json["how_it_fails"]["last_steps"][0]["bound_to_fail"].get<double>(),
            json["how_it_fails"]["regime"]["bound_to_fail"].get<double>());
}

TEST_F(WalkerCommand, SplittingAgreesWithTheMesh) {
  const Ran alone = metastable(walker("steps", {"--method", "splitting", "--tolerance", "0.25", "--threads", "1",
                                                "--how-it-fails", "--json", path("s.json")}));
  ASSERT_EQ(alone.code, 0) << alone.err;
  for (const char* said : {"by splitting: the rounds agree", "independent lines to failure", "steps of the map"})
    EXPECT_NE(alone.out.find(said), std::string::npos) << said << '\n' << alone.out;
  const auto json = nlohmann::json::parse(read(path("s.json")));
  EXPECT_EQ(json["status"], "rounds_agree");
  const auto first = json["survival_interval_95"][1], after = json["survival_after"][1];
  EXPECT_LT(first[0].get<double>(), json["survival"][1].get<double>());
  EXPECT_GT(first[1].get<double>(), json["survival"][1].get<double>());
  EXPECT_NEAR(after["steps"].get<double>(), json["expected_steps"]["value"].get<double>(), 0.6);
  EXPECT_LT(after["interval_95"][0].get<double>(), after["share"].get<double>());
  EXPECT_NE(alone.out.find("still walking after 1 step "), std::string::npos) << alone.out;
  const auto last = json["how_it_fails"]["last_steps"][0]["noise"]["slope [deg]"];
  EXPECT_LE(last["median_interval_95"][0].get<double>(), last["median"].get<double>());
  EXPECT_LE(last["middle_90_intervals_95"][0][0].get<double>(), last["middle_90"][0].get<double>());
  EXPECT_NE(alone.out.find("The medians, with 95 % intervals from the rounds"), std::string::npos) << alone.out;
  EXPECT_EQ(json["split_by"], "nothing");  // failures are frequent
  const Ran both = metastable(walker("steps", {"--method", "auto", "--spacing", "0.9", "--simulated-steps", "50000",
                                               "--tolerance", "0.25", "--json", path("b.json")}));
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_NE(both.out.find("Beside it, by splitting"), std::string::npos) << both.out;
  const auto beside = nlohmann::json::parse(read(path("b.json")));
  EXPECT_EQ(beside["splitting"]["expected_steps"], json["expected_steps"]);
  EXPECT_EQ(beside["status"], "agreed");
}

TEST_F(WalkerCommand, SplittingStandsAloneWhereTheMeshIsRefuted) {
  std::vector<std::string> steep{"steps",      "--walker", "compass",           "--slope", "30",
                                 "--slope-sd", "0.5",      "--simulated-steps", "20000"};
  const Ran mesh = metastable(steep);
  EXPECT_EQ(mesh.code, 3);
  EXPECT_NE(mesh.err.find("no number is given (the method splitting needs no mesh)"), std::string::npos) << mesh.err;
  steep.insert(steep.end(), {"--method", "auto", "--how-it-fails", "--json", path("steep.json")});
  const Ran both = metastable(steep);
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_NE(both.out.find("How it fails is not told: walks fail before the start is forgotten"), std::string::npos)
      << both.out;
  const auto json = nlohmann::json::parse(read(path("steep.json")));
  EXPECT_EQ(json["status"], "all_failed");
  EXPECT_TRUE(json["no_mesh"].get<std::string>().starts_with("the mesh")) << json["no_mesh"];
  EXPECT_NEAR(json["expected_steps"]["value"].get<double>(), 2.073, 0.02);  // 20000 walks simulated
  EXPECT_TRUE(json["failure_rate_per_step"].is_null() && json["mixing_steps"].is_null());
}

TEST_F(WalkerCommand, SimulateWritesEveryStep) {
  const Ran ran = metastable(walker("simulate", {"--trials", "5", "--out", path("walks")}));
  ASSERT_EQ(ran.code, 0) << ran.err;
  const std::string steps = read(path("walks/steps.csv")), trials = read(path("walks/trials.csv"));
  EXPECT_EQ(steps.find("trial,step,phase,half_angle_rad,stance_rate_rad_s\n"), 0u) << steps.substr(0, 400);
  EXPECT_NE(trials.find("5,"), std::string::npos);
  EXPECT_EQ(metastable(walker("simulate", {"--trials", "5", "--out", path("walks")})).code, 2);
  const std::vector<std::string> facets{"--terrain", "facets", "--trials", "5", "--out", path("facets")};
  ASSERT_EQ(metastable(walker("simulate", facets)).code, 0);
  EXPECT_NE(read(path("facets/walks.csv")).find("trial,step,half angle [rad],"), std::string::npos);
  const Ran wrong = metastable(walker("simulate", {"--effect", "leg_mass:mass_ratio=2", "--out", path("wrong")}));
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("--effect: 'leg_mass' is none of hip_damping"), std::string::npos) << wrong.err;
}

TEST_F(WalkerCommand, SimulateWalksInTheLaboratory) {
  const auto real = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"simulate", "--walker", "compass",      "--slope-sd", "0.3",   "--reality",
                                   "--trials", "3",        "--collisions", "5",          "--out", path("real")};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  for (const auto& [more, told] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--effect", "hip_dampin:damping=0.1"}, "did you mean 'hip_damping'?"},
           {{"--effect", "hip_damping:damping=99"}, "effect hip_damping: damping: 99 N m s/rad is outside [0, 5]"},
           {{"--outside", "planks:0.1"}, "outside effect: \"planks\" is none of round_feet"},
           {{"--outside", "round_feet:0.5"}, "effect round_feet: size 0.5 is outside [0, 0.2]"},
           {{"--outside", "round_feet"}, "--outside: 'round_feet' is not of the form ID:SIZE"},
           {{"--drop", "leg"}, "--drop: 'leg' is none of phase, time_s, position_m, outcome"},
           {{"--skewness", "1"}, "--skewness: has no meaning with --walker"},
           {{"--terrain", "facets"}, "--terrain: the laboratory has a plane that tilts anew"}}) {
    const Ran wrong = metastable(real(more));
    EXPECT_EQ(wrong.code, 2) << told;
    EXPECT_NE(wrong.err.find(told), std::string::npos) << wrong.err;
    EXPECT_FALSE(std::filesystem::exists(path("real")));
  }
  const Ran simplest = metastable(walker("simulate", {"--reality", "--out", path("real")}));
  EXPECT_NE(simplest.err.find("--reality: the laboratory has no walker simplest; it has the compass"),
            std::string::npos);
  const Ran ran = metastable(real({"--outside", "round_feet:0.02", "--effect", "leg_length:longer=0.01"}));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(read(path("real/steps.csv")).find("trial,step,phase,time_s,position_m,half_angle_rad,"), 0u);
}

TEST_F(WalkerCommand, SweepIsTakenUpAgain) {
  const std::vector<std::string> words =
      walker("sweep", {"--slope", "0.5", "--spacing", "1", "--simulated-steps", "20000", "--out", path("s.csv")});
  ASSERT_EQ(metastable(words).code, 0);
  const std::string rows = read(path("s.csv"));
  EXPECT_NE(rows.find("\n0.5,0.17,"), std::string::npos) << rows;
  EXPECT_NE(rows.find("agreed"), std::string::npos);
  const Ran again = metastable(words);
  EXPECT_NE(again.out.find("1 taken over"), std::string::npos) << again.out << again.err;
}

TEST_F(WalkerCommand, ABipedIsWalkedWithoutAMesh) {
  const std::vector<std::string> biped{"--walker", "biped", "--slope-sd", "3"};
  const auto asked = [&](std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), biped.begin(), biped.end());
    words.insert(words.end(), more.begin(), more.end());
    return metastable(words);
  };
  for (const Ran& meshed : {asked({"steps"}, {}), asked({"report"}, {"--out", path("report")})}) {
    EXPECT_EQ(meshed.code, 2);
    EXPECT_NE(meshed.err.find("the biped has 9 dimensions, where meshes hold 1 to 4"), std::string::npos) << meshed.err;
  }
  const Ran ran = asked({"simulate"}, {"--trials", "20", "--out", path("walks")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(read(path("walks/walks.csv")).find("half angle [rad],stance knee [rad],"), std::string::npos);
  const Ran effect = asked({"simulate"}, {"--effect", "hip_damping:damping=1", "--out", path("other")});
  EXPECT_EQ(effect.code, 2);
  EXPECT_NE(effect.err.find("--effect: has no meaning with --walker biped"), std::string::npos) << effect.err;
}

TEST_F(WalkerCommand, RefusesWhatHasNoMeaning) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"steps", "--walker", "simplest"}, "--slope-sd: is needed with --walker"},
      {{"steps", "--walker", "hopper", "--slope-sd", "1"}, "--walker: 'hopper' is none of simplest, compass, biped"},
      {walker("steps", {"--slope", "50"}), "--slope: 50 is outside (0, 45)"},
      {walker("steps", {"--friction", "0.3"}), "--friction: has no meaning with --walker"},
      {walker("steps", {"--certify"}), "--certify: has no meaning with --walker"},
      {walker("steps", {"--terrain", "sand"}), "--terrain: 'sand' is none of fresh, facets"},
      {walker("steps", {"--spacing", "3"}), "--spacing: 3 is outside [0.05, 2]"},
      {walker("compare", {}), "--slopes, --slope-sd: two slopes or two sds at least"},
      {walker("compare", {"--slopes", "0.5,0.6,0.7", "--slope-sd", "0.1,0.2"}), "--slope-sd: given 2 times"},
      {{"steps", "--terrain", "facets"}, "--terrain: has a meaning with --walker only"},
      {{"steps", "--slope-sd", "0.1"}, "--slope-sd: has a meaning with --walker only"}};
  for (const auto& [words, said] : cases) {
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 2) << said;
    EXPECT_EQ(ran.err, "metastable: " + said + "\n");
  }
  // There is no gait that is stable: a computation that failed, in one line that names the state.
  const Ran unstable = metastable({"steps", "--walker", "compass", "--slope", "30", "--slope-sd", "0.5"});
  EXPECT_EQ(unstable.code, 3);
  EXPECT_EQ(std::count(unstable.err.begin(), unstable.err.end(), '\n'), 1);
  // More memory than is allowed is refused before the meshes are made.
  const Ran large = metastable(walker("steps", {"--memory", "0.001"}));
  EXPECT_EQ(large.code, 3) << large.out;
  EXPECT_NE(large.err.find("are allowed"), std::string::npos) << large.err;
}

TEST_F(WalkerCommand, TheWheelSaysHowItFails) {
  const Ran ran = metastable(
      {"steps", "--legs", "0.1519", "--cells", "64", "--samples", "512", "--how-it-fails", "--json", path("h.json")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("How it fails: the last steps"), std::string::npos) << ran.out;
  const auto json = nlohmann::json::parse(read(path("h.json")))["how_it_fails"];
  EXPECT_GT(json["last_steps"][0]["bound_to_fail"].get<double>(), json["last_steps"][2]["bound_to_fail"].get<double>());
  EXPECT_EQ(json["most_likely_path"].size(), json["last_steps"].size());
}

}  // namespace
}  // namespace metastable::reports::test
