// metastable import --walker: walks that a CSV tells come back as the same walks.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "analysis/walker_model/walk_folder.h"
#include "tests/reports/import/importing.h"

namespace metastable::reports::test {
namespace {

// Walks of which one fell; the file has degrees, mixes the rows of the trials, and lacks a rate.
TEST_F(Import, WalksInOtherWordsAndUnits) {
  const std::string csv = file("walks.csv",
                               "run,k,foot,theta [deg],rate [deg/s],end\n1,0,0,15,-60,ok\n2,0,1,15.5,-61,fell\n"
                               "1,1,1,15.2,NaN,ok\n2,1,0,14.9,-59,fell\n");
  const Words words{csv,
                    "--walker",
                    "compass",
                    "--slope",
                    "3",
                    "--slope-sd",
                    "0.3",
                    "--collisions-from",
                    "0",
                    "--legs-from",
                    "0",
                    "--outcomes",
                    "failed=fell,stopped=ok",
                    "--errors",
                    "half_angle=0.0005",
                    "--columns",
                    "trial=run,step=k,phase=foot,half_angle=theta,stance_rate=rate,outcome=end"};
  const Ran ran = import(words);
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(ran.out.substr(0, ran.out.find('\n')), path("out") + ": 2 trials, 4 steps");
  const auto walks = analysis::read_walks(folder_ / "out");
  ASSERT_TRUE(walks);
  ASSERT_EQ(walks->runs.trials.size(), 2u);
  const analysis::MachineTrial& first = walks->runs.trials[0];
  ASSERT_EQ(first.rows.size(), 2u);
  EXPECT_EQ(first.outcome, analysis::MachineOutcome::stopped);
  EXPECT_EQ(walks->runs.trials[1].outcome, analysis::MachineOutcome::failed);
  EXPECT_EQ(first.rows[0].inputs, std::vector<double>{1});
  EXPECT_NEAR(first.rows[0].seen[0], 15 * std::numbers::pi / 180, 1e-15);
  EXPECT_TRUE(std::isnan(first.rows[1].seen[1]));
  EXPECT_EQ(walks->machine->observe.size(), 2u);
  EXPECT_EQ(walks->machine->observe[0].sd, 0.0005);
  EXPECT_FALSE(walks->machine->observe[1].sd);
}

TEST_F(Import, WideWalks) {
  const std::string csv = file("wide.csv", "run,a1,a2,a3\n1,0.27,,0.26\n2,0.28,0.27,\n");
  const Ran ran = import({csv, "--walker", "simplest", "--slope", "0.5", "--slope-sd", "0.05", "--columns",
                          "trial=run,half_angle=a*[rad]"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(read(folder_ / "out" / "steps.csv"),
            "trial,step,half_angle_rad\n1,1,0.27\n1,2,\n1,3,0.26\n2,1,0.28\n2,2,0.27\n");
}

// A row was lost before the third one, and the file does not count its rows.
TEST_F(Import, RefusesWalksWhoseLegsDoNotTakeTurns) {
  const std::string csv = file("lost.csv", "run,foot,theta\n1,0,0.27\n1,1,0.28\n1,1,0.27\n2,0,0.27\n");
  expect_refused(import({csv, "--walker", "simplest", "--slope", "0.5", "--slope-sd", "0.05", "--legs-from", "0",
                         "--columns", "trial=run,phase=foot,half_angle=theta[rad]"}),
                 csv + ":4: phase: leg 2 does not stand after leg 2: a row is missing, or out of order");
}

// Walks of the compass gait, with its half angles times a factor.
std::string walks_with_angles(double factor) {
  analysis::WalkOptions options;
  options.trials = 6;
  options.longest = 12;
  options.threads = 1;
  const analysis::WalkerSetting setting{analysis::Walker::compass, 3, 0.3, dynamics::Terrain::fresh};
  const analysis::Walks walks =
      *analysis::parse_walks(analysis::source_of(analysis::draw_walks(setting, {}, options, "drawn"), "drawn"));
  std::string csv = "run,a,b,c\n";
  for (std::size_t t = 0; t < walks.runs.trials.size(); ++t)
    for (const analysis::MachineRow& row : walks.runs.trials[t].rows)
      csv += fmt::format("{},{:.6f},{:.6f},{:.6f}\n", t + 1, factor * row.seen[0], row.seen[1], row.seen[2]);
  return csv;
}

// The import says of units what a diagnosis would say.
TEST_F(Import, AsksAboutWalksInOtherUnits) {
  const auto said = [&](const std::string& csv, const std::string& unit_of_rates) {
    const Ran ran = import(
        {file("walks.csv", csv), "--walker", "compass", "--slope", "3", "--slope-sd", "0.3", "--columns",
         "trial=run,half_angle=a[rad],stance_rate=b[" + unit_of_rates + "],swing_rate=c[" + unit_of_rates + "]"});
    EXPECT_EQ(ran.code, 0) << ran.err;
    return ran.out;
  };
  EXPECT_EQ(said(walks_with_angles(1), "rad/s").find("note: "), std::string::npos);
  const std::string full = said(walks_with_angles(2), "rad/s");
  EXPECT_NE(full.find("note: `diagnose` will refuse these walks: step: without noise the machine fails"),
            std::string::npos)
      << full;
  EXPECT_NE(full.find("check that angles are in radians, that half_angle_rad is half"), std::string::npos) << full;
  const std::string slow = said(walks_with_angles(1), "deg/s");
  EXPECT_NE(slow.find("note: "), std::string::npos) << slow;
}

TEST_F(Import, NamesWhatWalksLack) {
  const std::string csv = file("a.csv", "run,foot,theta\n1,0,15\n1,1,14\n");
  const auto walks = [&](Words more) {
    Words words{csv, "--walker", "compass"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--slope", "3"});
    return import(words);
  };
  expect_refused(walks({}), "--slope-sd: is needed with --walker");
  expect_refused(walks({"--slope-sd", "0.3", "--mass", "1"}), "--mass: has no meaning with --walker");
  expect_refused(walks({"--slope-sd", "0.3"}),
                 "--columns: which column of " + csv + " is half_angle? It has run, foot, theta");
  expect_refused(walks({"--slope-sd", "0.3", "--columns", "trial=run,omega_minus=theta[deg/s]"}),
                 "--columns: 'omega_minus=theta[deg/s]' is not WHAT=NAME or WHAT=NAME[UNIT], where WHAT is one of "
                 "condition, trial, time, position, outcome, step, phase, half_angle, stance_rate, swing_rate");
  expect_refused(walks({"--slope-sd", "0.3", "--columns", "trial=run,phase=foot,half_angle=theta[deg]"}),
                 csv + ":2: phase: 0 is outside 1..2");
  const std::string letters = file("letters.csv", "run,foot,theta\n1,L,15\n1,2,14\n");
  expect_refused(
      import({letters, "--walker", "compass", "--slope", "3", "--slope-sd", "0.3", "--columns",
              "trial=run,phase=foot,half_angle=theta[deg]"}),
      letters +
          ":2:3: foot: 'L' is not a finite number; phases are numbers: write 1 where leg 1 stands and 2 where leg 2 "
          "does (or 0 and 1, and --legs-from 0)");
  expect_refused(walks({"--slope-sd", "0.3", "--errors", "theta=1"}),
                 "--errors: 'theta' is none of half_angle, stance_rate, swing_rate");
  expect_refused(walks({"--slope-sd", "0.3", "--columns", "trial=run,half_angle=theta[deg]", "--errors",
                        "half_angle=0.001,swing_rate=0.1"}),
                 "--errors: swing_rate: " + csv + " holds no value of it");
  expect_refused(import({file("rates.csv", "run,a,b\n1,0.27,-1\n"), "--walker", "simplest", "--slope", "0.5",
                         "--slope-sd", "0.05", "--columns", "trial=run,half_angle=a[rad],swing_rate=b[rad/s]"}),
                 "--columns: swing_rate: the simplest walker is told by half_angle and stance_rate; leave it out");
  expect_refused(import({csv, "--slope", "3", "--slope-sd", "0.3"}), "--slope-sd: has a meaning with --walker only");
}

}  // namespace
}  // namespace metastable::reports::test
