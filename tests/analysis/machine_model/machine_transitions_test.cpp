// Machines that their user brings are diagnosed: what was done to the runs is named.

#include "analysis/machine_model/machine_transitions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "analysis/diagnosis/diagnosis.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

Diagnosis diagnosed(const Machine& machine, MachineRuns runs) {
  return diagnose(machine_transitions(std::make_shared<const Machine>(machine), std::move(runs)), {.draws = 400});
}

std::string said(const Diagnosis& d) {
  std::string all = verdict_name(d.verdict);
  for (const std::string& sentence : d.sentences) all += "\n  " + sentence;
  for (std::size_t i = 0; i < std::min<std::size_t>(4, d.causes.ranked.size()); ++i)
    all += "\n  " + d.causes.ranked[i].name() + " " + std::to_string(d.causes.ranked[i].probability);
  return all;
}

// A change made to the runs, and the size of the parameter that should be found.
struct Done {
  const char* cause;
  double bend, drift, spread, size;
};

class WhatWasDone : public testing::TestWithParam<Done> {};

TEST_P(WhatWasDone, IsNamedWithItsSize) {
  const Done& done = GetParam();
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  std::vector<double> off;
  for (int t = 0; t < 100; ++t) off.push_back(done.drift * (t / 99.0 - 0.5) + done.spread * normal(generator));
  const auto next = [&](double x, double z, std::size_t t) {
    return 0.8 * x + 0.3 + off[t] + 0.2 * z + done.bend * x * x;
  };
  const Diagnosis d = diagnosed(linear_machine(0.05), scalar_runs(100, 20, 1.5, 0.05, 17, next));
  if (done.size == 0) {
    EXPECT_EQ(d.verdict, Verdict::no_gap) << said(d);
    return;
  }
  ASSERT_EQ(d.verdict, Verdict::explained) << said(d);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{done.cause}) << said(d);
  const EstimatedParameter& found = d.causes.ranked.front().parameters[0][0];
  EXPECT_LT(found.lower, done.size) << said(d);
  EXPECT_GT(found.upper, done.size) << said(d);
}

INSTANTIATE_TEST_SUITE_P(MachineTransitions, WhatWasDone,
                         testing::Values(Done{"nothing", 0, 0, 0, 0}, Done{"bend", -0.05, 0, 0, -0.05},
                                         Done{"b_drift", 0, 0.3, 0, 0.3}, Done{"b_spread", 0, 0, 0.15, 0.15}),
                         [](const auto& instance) { return std::string(instance.param.cause); });

}  // namespace
}  // namespace metastable::analysis::test
