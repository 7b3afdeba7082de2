// The variations without a name are found in runs of a machine in which something swings.

#include "analysis/machine_model/machine_variations.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/machine_model/machine_transitions.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

constexpr double swing_cycles = 0.42;  // a step, between two of the frequencies that are tried

// Runs of the linear machine with a drift of b by 0.4, in which something swings, from a phase of its own in each trial
// or from the launch.
MachineRuns swinging(double amplitude, bool own_phases) {
  constexpr std::size_t trials = 60, rows = 15;
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> phases(0, 2 * std::numbers::pi);
  std::vector<double> phase;
  for (std::size_t t = 0; t < trials; ++t) phase.push_back(own_phases ? phases(generator) : 1);
  std::size_t trial = trials, step = 0;
  return scalar_runs(trials, rows, 1.5, 0.05, 19, [&](double x, double z, std::size_t t) {
    step = t == trial ? step + 1 : 1;
    trial = t;
    const double now = 2 * std::numbers::pi * swing_cycles * static_cast<double>(step) + phase[t];
    const double size = own_phases ? amplitude : 2 * amplitude * std::exp(-0.1 * static_cast<double>(step));
    return 0.8 * x + 0.3 + 0.2 * z + 0.4 * (static_cast<double>(t) / 59 - 0.5) + size * std::cos(now);
  });
}

Diagnosis diagnosed_swings(MachineRuns runs) {
  return diagnose(machine_transitions(std::make_shared<const Machine>(linear_machine(0.05)), std::move(runs)),
                  {.draws = 400});
}

std::string verdict_told(const Diagnosis& d) {
  std::string all = verdict_name(d.verdict);
  for (const std::string& sentence : d.sentences) all += "\n  " + sentence;
  return all;
}

// A swing is said to be there beside the drift, which keeps its name.
class Swings : public testing::TestWithParam<bool> {};

TEST_P(Swings, AreSaidBesideAnEffect) {
  const Diagnosis d = diagnosed_swings(swinging(0.15, GetParam()));
  ASSERT_EQ(d.verdict, Verdict::partly_explained) << verdict_told(d);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"b_drift"}) << verdict_told(d);
  EXPECT_GT(d.causes.p_unnamed, 0.9) << verdict_told(d);
  ASSERT_FALSE(d.causes.unnamed_facets.empty());
  EXPECT_EQ(d.causes.unnamed_facets.front().facet, GetParam() ? "a swing in each trial" : "a swing from the launch");
}

INSTANTIATE_TEST_SUITE_P(MachineVariations, Swings, testing::Bool(),
                         [](const auto& instance) { return instance.param ? "OwnPhases" : "FromTheLaunch"; });

TEST(MachineVariations, NothingSwingsWhereNothingDoes) {
  const Diagnosis d = diagnosed_swings(swinging(0, true));
  ASSERT_EQ(d.verdict, Verdict::explained) << verdict_told(d);
  EXPECT_LT(d.causes.p_unnamed, 0.2) << verdict_told(d);
}

}  // namespace
}  // namespace metastable::analysis::test
