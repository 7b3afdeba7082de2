// Two machines' trials in one folder are told from one machine whose trials differ.

#include "analysis/gap/trial_groups.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/statistics/random.h"
#include "dynamics/numerics/truncated_normal.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

constexpr std::size_t trials = 40;

// Returns the note on trials whose b is off by so much, trial by trial; empty where there is none. The state forgets
// its past fast, so that no law of the state can say of which machine a trial is.
std::string said_of(unsigned seed, const std::function<double(std::size_t)>& off) {
  const auto next = [&](double x, double z, std::size_t t) { return 0.2 * x + 0.3 + off(t) + 0.2 * z; };
  Machine machine = linear_machine(0.05);
  machine.parameters[0].nominal = 0.2;
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"bend", "b_spread", "b_drift", "memory"};
  const auto model =
      machine_transitions(std::make_shared<const Machine>(machine), scalar_runs(trials, 14, 0.4, 0.05, seed, next));
  const Diagnosis d = decide_each(*model, options, {options.rules}).front();
  for (const std::string& note : d.data.notes)
    if (note.find("two groups") != std::string::npos) return note;
  return "";
}

TEST(TrialGroups, ASplitLeavesTheLeastSumOfSquares) {
  std::vector<TrialValue> values;
  for (std::size_t t = 0; t < 12; ++t)
    values.push_back({t, (t % 3 == 0 ? 10.0 : 0.0) + 0.1 * static_cast<double>(t), 1});
  const auto groups = split(values);
  ASSERT_TRUE(groups);
  EXPECT_EQ(groups->fewer, (std::vector<std::size_t>{0, 3, 6, 9}));
  EXPECT_EQ(groups->sorted, 12u);
  EXPECT_FALSE(split({values.begin(), values.begin() + 5})) << "too few for two groups of three";
}

// The best split of a normal lies at its mean and leaves 1 - 2/pi of the squares; that of a sine leaves 1 - 8/pi^2.
TEST(TrialGroups, ASplitOfASineLeavesTheShareOfTheClosedForm) {
  constexpr std::size_t n = 20000;
  std::vector<TrialValue> sine, normal;
  for (std::size_t t = 0; t < n; ++t) {
    const double share = (static_cast<double>(t) + 0.5) / n;
    sine.push_back({t, std::sin(2 * std::numbers::pi * share), 1});
    normal.push_back({t, dynamics::normal_quantile(share), 1});
  }
  EXPECT_NEAR(split(sine)->gain / n, -std::log(1 - 8 / (std::numbers::pi * std::numbers::pi)), 1e-3);
  EXPECT_NEAR(split(normal)->gain / n, -std::log(1 - 2 / std::numbers::pi), 1e-3);
}

TEST(TrialGroups, TheChanceLevelIsThatOfASine) {
  int below = 0;
  for (std::uint64_t draw = 0; draw < 200; ++draw) {
    std::vector<TrialValue> values;
    for (std::size_t t = 0; t < 30; ++t)
      values.push_back({t, std::sin(2 * std::numbers::pi * uniform_at(99, draw, t, 1)), 1});
    below += split_p_value(split(values)->gain, 30, 5) < 0.1;
  }
  EXPECT_NEAR(below, 20, 5 * std::sqrt(200 * 0.1 * 0.9));
}

TEST(TrialGroups, TrialsOfTwoMachinesAreSaidWhateverTheirOrder) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const std::string mixed = said_of(seed, [](std::size_t t) { return t % 4 == 1 ? 0.6 : 0.0; });
    EXPECT_NE(mixed.find("10 of 40 (trials 2, 6, 10, 14, 18, ...)"), std::string::npos) << seed << ": " << mixed;
    const std::string one_after_the_other = said_of(seed, [](std::size_t t) { return t < 16 ? 0.6 : 0.0; });
    EXPECT_NE(one_after_the_other.find("16 of 40 (trials 1, 2, 3, 4, 5, ...)"), std::string::npos)
        << seed << ": " << one_after_the_other;
  }
}

// The groups overlap, so that only their order tells.
TEST(TrialGroups, TrialsOfOneMachineAfterAnotherAreSaidWhereTheyOverlap) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const std::string said = said_of(seed, [](std::size_t t) { return t < 24 ? 0.0 : 0.3; });
    EXPECT_NE(said.find("two groups"), std::string::npos) << seed << ": " << said;
  }
}

TEST(TrialGroups, ABreakIsHeldAgainstADrift) {
  std::vector<TrialValue> step, drift;
  for (std::size_t t = 0; t < 24; ++t) {
    const double noise = t % 2 == 0 ? 0.1 : -0.1;
    step.push_back({t, (t < 9 ? 0.0 : 1.0) + noise, 1});
    drift.push_back({t, static_cast<double>(t) / 24 + noise, 1});
  }
  const auto at = broken(step);
  ASSERT_TRUE(at);
  EXPECT_EQ(at->fewer, (std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_GT(at->gain, 20);
  EXPECT_LT(broken(drift)->gain, 0);
  EXPECT_FALSE(broken({step.begin(), step.begin() + 8})) << "too few";
}

// All trials of the other machine differ one way if the parameters are known, and by many sds of a sharp sensor.
TEST(TrialGroups, AreSaidWhereTheOtherMachineAloneDiffersFromTheModel) {
  Machine machine = linear_machine(0.002);
  for (MachineParameter& p : machine.parameters) p.sd = 0;
  machine.parameters[0].nominal = 0.2;
  machine.effects.push_back({"push", {{"more", 0, -1, 1}}});
  machine.step = [step = machine.step, more = machine.value_names().size() - 1](const MachineBatch& batch) {
    step(batch);
    for (std::size_t i = 0; i < batch.rows; ++i) batch.next[i] += batch.value(more, i);
  };
  const auto next = [](double x, double z, std::size_t t) { return 0.2 * x + 0.3 + (t % 2 == 1 ? 3 : 0) + 0.2 * z; };
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"push", "sensor_noise_x"};
  const auto model =
      machine_transitions(std::make_shared<const Machine>(machine), scalar_runs(trials, 14, 0.4, 0.002, 1, next));
  const Diagnosis d = decide_each(*model, options, {options.rules}).front();
  EXPECT_TRUE(std::ranges::any_of(d.data.notes, [](const std::string& note) {
    return note.find("20 of 40 (trials ") != std::string::npos;
  })) << fmt::format("{}", fmt::join(d.data.notes, "\n"));
}

// At most one folder of a hundred is said to hold two machines by chance: of these 35 one may be.
TEST(TrialGroups, TrialsThatDifferOtherwiseAreNoTwoMachines) {
  std::string all;
  int two = 0;
  const auto count = [&](unsigned seed, const char* what, const std::function<double(std::size_t)>& off) {
    const std::string said = said_of(seed, off);
    if (said.empty()) return;
    ++two;
    all += fmt::format("{}, {}: {}\n", what, seed, said);
  };
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U}) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> own;
    for (std::size_t t = 0; t < trials; ++t) own.push_back(normal(generator));
    count(seed, "alike", [](std::size_t) { return 0.0; });
    for (const double size : {0.15, 0.6}) {
      count(seed, "spread", [&](std::size_t t) { return size * own[t]; });
      count(seed, "drift", [&](std::size_t t) { return size * (static_cast<double>(t) / 20 - 1); });
      count(seed, "a slow wave", [&](std::size_t t) { return size * std::sin(0.7 * static_cast<double>(t)); });
    }
  }
  EXPECT_LE(two, 1) << all;
}

}  // namespace
}  // namespace metastable::analysis::test
