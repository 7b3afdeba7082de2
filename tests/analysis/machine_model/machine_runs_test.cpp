// Measured runs of a machine, before anything is fitted.

#include "analysis/machine_model/machine_runs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "analysis/machine_model/machine_design.h"
#include "tests/analysis/machine_model/machines.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

// A counter that stands far from zero has the spread of its values all the same.
TEST(MachineRunsColumn, FarFromZeroKeepsItsSpread) {
  MachineRuns runs;
  runs.trials.resize(1);
  for (const double x : {1e9 - 1, 1e9, missing, 1e9 + 1}) runs.trials[0].rows.push_back({.seen = {x}});
  EXPECT_DOUBLE_EQ(column_spread(runs, 0).mean, 1e9);
  EXPECT_DOUBLE_EQ(column_spread(runs, 0).sd, std::sqrt(2.0 / 3));
}

// One run is cut into trials by its clock; the third trial begins anew.
TEST(GoesOn, IsATrialThatBeginsAStepAfterTheOneBefore) {
  MachineRuns runs;
  double time = 0;
  for (int t = 0; t < 3; ++t) {
    MachineTrial& trial = runs.trials.emplace_back();
    if (t == 2) time += 5;
    for (int k = 0; k < 4; ++k, time += 0.5) {
      MachineRow& row = trial.rows.emplace_back();
      row.time = time;
      row.seen = {0.1 * k};
      row.inputs = {10.0 * t + k};
    }
  }
  EXPECT_FALSE(goes_on(runs, 0));
  EXPECT_TRUE(goes_on(runs, 1));
  EXPECT_FALSE(goes_on(runs, 2));
  const auto input = [&](std::size_t trial, std::size_t row, std::size_t steps) {
    const RowPlace at = row_before(runs, trial, row, steps);
    return runs.trials[at.trial].rows[at.row].inputs[0];
  };
  EXPECT_EQ(input(1, 3, 2), 11);
  EXPECT_EQ(input(1, 1, 2), 3);
  EXPECT_EQ(input(2, 1, 2), 20);
}

// A level has one sign. The last row of a trial begins no step, and may lack its input.
TEST(MisreadRuns, HoldEachChangeOfEachColumn) {
  Machine machine = linear_machine(0.05);
  machine.inputs = {"force"};
  MachineRuns runs;
  runs.trials.resize(2);
  runs.trials[0].rows = {{.seen = {1}, .inputs = {-1}}, {.seen = {2}, .inputs = {2}}, {.seen = {3}, .inputs = {4}}};
  runs.trials[1].rows = {{.seen = {5}, .inputs = {1}}, {.seen = {6}, .inputs = {1}}};  // too few
  const auto changes = [&] {
    std::string all;
    for (const MisreadRuns& one : misread_runs(machine, runs)) all += one.change + "\n";
    return all;
  };
  const std::string shifts =
      "x: with its values one row later\nx: with its values one row earlier\n"
      "force: with its values one row later\nforce: with its values one row earlier\n"
      "force: with the other sign\n";
  EXPECT_EQ(changes(), shifts + "runs: with the rows of every trial in the opposite order\n");
  const std::vector<MisreadRuns> all = misread_runs(machine, runs);
  ASSERT_EQ(all.back().runs.trials.size(), 1U);
  EXPECT_EQ(all.back().runs.trials[0].rows[0].seen[0], 3);
  EXPECT_EQ(all.back().runs.trials[0].rows[0].inputs[0], 4);
  const std::vector<MachineRow> later = all[2].runs.trials[0].rows;
  ASSERT_EQ(later.size(), 2U);
  EXPECT_EQ(later[0].seen[0], 2);
  EXPECT_EQ(later[0].inputs[0], -1);
  runs.trials[0].rows[2].inputs = {missing};
  EXPECT_EQ(changes(), shifts);
}

class LookedOver : public ::testing::Test {
 protected:
  LookedOver() {
    machine_.inputs = {"warmth"};
    for (std::size_t t = 0; t < runs_.trials.size(); ++t)
      for (std::size_t k = 0; k < runs_.trials[t].rows.size(); ++k)
        runs_.trials[t].rows[k].inputs = {20 + 0.1 * static_cast<double>((3 * t + k) % 7)};
  }

  // Multiplies a column in the trials from `first` to the one before `end`.
  void scale(std::vector<double> MachineRow::*column, double factor, std::size_t first, std::size_t end) {
    for (std::size_t t = first; t < end; ++t)
      for (MachineRow& row : runs_.trials[t].rows) (row.*column)[0] *= factor;
  }
  std::string said() const {
    std::string all;
    for (const std::string& sentence : look_over(machine_, runs_)) all += sentence + "\n";
    return all;
  }

  Machine machine_ = linear_machine(0.05);
  MachineRuns runs_ =
      scalar_runs(20, 12, 1.5, 0.05, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
};

TEST_F(LookedOver, NothingIsSaidOfRunsAsTheyShouldBe) { EXPECT_EQ(said(), ""); }

TEST_F(LookedOver, AStepThatHangsOnOtherRowsIsRefused) {
  const auto right = machine_.step;
  machine_.step = [&](const MachineBatch& batch) {  // It takes the noise of the first row for all.
    std::vector<double> scores(batch.rows, batch.scores[0]);
    MachineBatch same = batch;
    same.scores = scores;
    right(same);
  };
  const std::string turned = message_of([&] { said(); });
  EXPECT_NE(turned.find("when the rows stand in another order"), std::string::npos) << turned;
  machine_.step = [&](const MachineBatch& batch) {  // It takes the first number of each parameter for all.
    std::vector<std::span<const double>> first;
    for (const std::span<const double> values : batch.values) first.push_back(values.first(1));
    MachineBatch same = batch;
    same.values = first;
    right(same);
  };
  const std::string mixed = message_of([&] { said(); });
  EXPECT_NE(mixed.find("arrays of one number a row"), std::string::npos) << mixed;
}

// A mean over every other row is nearly that of all rows, and the largest of all is among them in half of the cases.
TEST_F(LookedOver, AStepThatTakesTheMeanOrTheLargestOfAllRowsIsRefused) {
  const auto right = machine_.step;
  for (const bool largest : {false, true})
    for (const double share : {0.3, 0.003}) {
      machine_.step = [&](const MachineBatch& batch) {
        right(batch);
        double mean = 0;
        for (std::size_t i = 0; i < batch.rows; ++i) mean += batch.states[i] / static_cast<double>(batch.rows);
        const double of_all = largest ? std::ranges::max(batch.states) : mean;
        for (std::size_t i = 0; i < batch.rows; ++i) batch.next[i] -= share * of_all;
      };
      const std::string said_of_it = message_of([&] { said(); });
      EXPECT_NE(said_of_it.find("when some of the others are not asked for"), std::string::npos)
          << said_of_it << largest << share;
    }
}

// Squares of such values overflow, or are lost.
TEST_F(LookedOver, ColumnsOfASizeThatNoMachineHasAreRefused) {
  const MachineRuns right = runs_;
  for (const double factor : {1e300, 1e-300, 1e120, 1e-120}) {
    runs_ = right;
    for (MachineTrial& trial : runs_.trials)
      for (MachineRow& row : trial.rows) row.seen[0] *= factor;
    const std::string refused = message_of([&] { said(); });
    EXPECT_EQ(refused.find("runs: x goes from "), 0u) << refused;
    EXPECT_NE(
        refused.find(": values up to 1e+100 that differ by 1e-100 or more are expected: is it in another unit than "
                     "the machine?"),
        std::string::npos)
        << refused;
  }
}

TEST_F(LookedOver, ColumnsFarFromTheMachinesSizeAreAskedAbout) {
  const MachineRuns right = runs_;
  for (const double factor : {1e6, 1e-6}) {
    runs_ = right;
    for (MachineTrial& trial : runs_.trials)
      for (MachineRow& row : trial.rows) row.seen[0] *= factor;
    EXPECT_NE(said().find("times what the machine makes of the rows before: is it in another unit?"), std::string::npos)
        << said();
  }
}

TEST_F(LookedOver, NoiseThatChangesNothingIsNoted) {
  machine_.scores = 2;
  machine_.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) + batch.value(2, i) * batch.scores[2 * i];
  };
  EXPECT_NE(said().find("number 2 of the noise changes nothing"), std::string::npos) << said();
}

// Trials of these runs begin at 1.5.
TEST_F(LookedOver, LaunchesThatAreNotThoseStatedAreNoted) {
  machine_.launches = {{"x", 1.5, 0.1}};
  EXPECT_EQ(said(), "");
  machine_.launches = {{"x", 1.2, 0.1}};
  EXPECT_NE(said().find("launch: x begins at 1.4"), std::string::npos) << said();
  EXPECT_NE(said().find("in the mean of 20 trials, and 1.2 +- 0.1 is stated: "), std::string::npos) << said();
  machine_.launches = {{"x", 1.2, 0.1, true}};
  EXPECT_EQ(said(), "");
}

// Trials of these runs begin at places with an sd of 0.3.
TEST_F(LookedOver, LaunchesThatAreNeitherStatedNorSeenAreAskedFor) {
  EXPECT_EQ(unseen_launches(machine_, runs_), "");
  machine_.observe[0].sd = 0.2;
  EXPECT_EQ(unseen_launches(machine_, runs_).find("launch: the first values of x scatter little beyond"), 0u);
  machine_.launches = {{"x", 1.5, 0.1}};
  EXPECT_EQ(unseen_launches(machine_, runs_), "");
}

// Values that scatter about zero are any multiple of what the map makes of the rows before: here -1.2, pi / 180 and 1.3
// times as much in turn. Were all of them pi / 180 times as much, radians would be asked about.
TEST_F(LookedOver, ValuesAboutZeroAreInNoOtherUnit) {
  machine_.parameters[1].nominal = 0;
  for (const bool alike : {false, true}) {
    for (std::size_t t = 0; t < runs_.trials.size(); ++t)
      for (std::size_t k = 0; k < runs_.trials[t].rows.size(); ++k) {
        const double radians = std::numbers::pi / 180;
        const double ratio = alike || t % 3 == 0 ? radians : t % 3 == 1 ? -1.2 : 1.3;
        runs_.trials[t].rows[k].seen = {k % 3 == 2 ? missing : k % 3 == 1 ? 0.8 * ratio : 1.0};
      }
    EXPECT_EQ(said().find("x: its values are 0.0175 times") != std::string::npos, alike) << said();
  }
}

TEST_F(LookedOver, ALabelThatNamesTwoMachinesIsRefused) {
  runs_.labels = {{"machine", {"old", "new"}}};
  for (std::size_t t = 0; t < runs_.trials.size(); ++t)
    for (MachineRow& row : runs_.trials[t].rows) row.labels = {t < 7 ? 0 : 1};
  EXPECT_EQ(message_of<std::invalid_argument>([&] { said(); }),
            "machine: trial 1 is of old and trial 8 of new: give each machine runs of its own");
  runs_.labels[0].name = "crew";
  EXPECT_EQ(said(), "");
}

TEST_F(LookedOver, OneTrialInDegreesIsSuspected) {
  scale(&MachineRow::seen, 180 / std::numbers::pi, 4, 5);
  EXPECT_NE(said().find("x: its values in trial 5 are "), std::string::npos) << said();
  EXPECT_NE(said().find("those of the others: is it in degrees where the others are in radians?"), std::string::npos)
      << said();
}

TEST_F(LookedOver, HalfOfTheTrialsInDegreesAreSuspected) {
  scale(&MachineRow::seen, 180 / std::numbers::pi, 10, 20);
  EXPECT_NE(said().find("x: its values in 10 of 20 trials (trial 11 for one) are "), std::string::npos) << said();
}

// Trials of a machine that decays faster have another median as well, so that only their first values show the unit.
TEST_F(LookedOver, TrialsOfAnotherMachineInDegreesAreSuspectedByWhereTheyBegin) {
  for (std::size_t t = 10; t < 20; ++t)
    for (std::size_t k = 0; k < 12; ++k)
      runs_.trials[t].rows[k].seen[0] *= 180 / std::numbers::pi * std::pow(0.5, static_cast<double>(k));
  EXPECT_NE(said().find("x: its first values in 10 of 20 trials (trial 11 for one) are "), std::string::npos) << said();
}

TEST_F(LookedOver, AnInputInAnotherUnitIsSuspected) {
  scale(&MachineRow::inputs, 0.001, 0, 3);
  EXPECT_NE(
      said().find(
          "warmth: its values in 3 of 20 trials (trial 1 for one) are 0.001 times those of the others: are these in "
          "thousands of the others' unit?"),
      std::string::npos)
      << said();
}

TEST_F(LookedOver, TrialsThatDifferByNoUnitAreNot) {
  scale(&MachineRow::seen, 5, 4, 5);
  scale(&MachineRow::inputs, 10, 10, 20);
  EXPECT_EQ(said().find("the others"), std::string::npos) << said();
}

TEST_F(LookedOver, ATrialThatStandsStillIsNamed) {
  for (MachineRow& row : runs_.trials[3].rows) row.seen = {1.25};
  EXPECT_NE(said().find("x: it is 1.25 in every row of trial 4: did its sensor stand still?"), std::string::npos)
      << said();
}

TEST_F(LookedOver, AnInputThatIsConstantIsNamed) {
  for (MachineTrial& trial : runs_.trials)
    for (MachineRow& row : trial.rows) row.inputs = {20};
  EXPECT_EQ(said(), "warmth: it is 20 in every row: an input that is constant does not show what it does\n");
}

// The last row of a trial begins no step.
TEST_F(LookedOver, PhasesThatAreMissingAreNoted) {
  runs_.phases = {"left", "right"};
  for (MachineTrial& trial : runs_.trials)
    for (std::size_t k = 0; k + 1 < trial.rows.size(); ++k) trial.rows[k].phase = static_cast<int>(k % 2);
  EXPECT_EQ(said(), "");
  for (MachineRow& row : runs_.trials[3].rows) row.phase = -1;
  EXPECT_EQ(said(), "phase: 11 of 220 steps have none, and effects by phase are not sought in these\n");
}

TEST_F(LookedOver, TimeThatRunsBackIsRefused) {
  for (std::size_t k = 0; k < 12; ++k) runs_.trials[2].rows[k].time = 0.5 * static_cast<double>(k);
  runs_.trials[2].rows[4].time = missing;
  EXPECT_EQ(said(), "");
  runs_.trials[2].rows[5].time = 1.25;
  EXPECT_EQ(message_of<std::invalid_argument>([&] { said(); }),
            "time_s: it runs back in trial 3, row 6: 1.25 comes after 1.5");
}

/// Returns what is asked about a heading that gains 0.7 rad a step in six trials, as the log has it.
std::vector<std::string> asked_of_headings(double unit, bool wrapped) {
  Machine machine;
  machine.observe = {{"heading", 0.01}};
  MachineRuns runs;
  runs.trials.resize(6);
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (std::size_t k = 0; k < 30; ++k) {
      const double heading = static_cast<double>(t) + 0.7 * static_cast<double>(k);
      runs.trials[t].rows.push_back(
          {.seen = {unit * (wrapped ? std::remainder(heading, 2 * std::numbers::pi) : heading)}});
    }
  return wrapping_columns(machine, runs);
}

TEST(WrappingColumns, AreAskedAboutInEitherUnit) {
  for (const double unit : {1.0, 180 / std::numbers::pi}) {
    const std::vector<std::string> asked = asked_of_headings(unit, true);
    ASSERT_EQ(asked.size(), 1u);
    EXPECT_EQ(asked[0].find("heading: it jumps by about " + std::string(unit == 1 ? "2 pi" : "360 degrees")), 0u)
        << asked[0];
    EXPECT_TRUE(asked[0].ends_with('?'));
    EXPECT_TRUE(asked_of_headings(unit, false).empty());
  }
}

TEST(WrappingColumns, ValuesThatMoveAsWidelyOtherwiseAreNone) {
  Machine machine;
  machine.observe = {{"height", 0.01}};
  MachineRuns runs;
  runs.trials.resize(1);
  for (std::size_t k = 0; k < 200; ++k)  // The values are spread over a turn at random.
    runs.trials[0].rows.push_back(
        {.seen = {2 * std::numbers::pi * std::fmod(0.618034 * static_cast<double>(k * k), 1)}});
  EXPECT_TRUE(wrapping_columns(machine, runs).empty());
}

}  // namespace
}  // namespace metastable::analysis::test
