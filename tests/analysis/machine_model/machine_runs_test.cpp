// Measured runs of a machine, before anything is fitted.

#include "analysis/machine_model/machine_runs.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/analysis/machine_model/machines.h"

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

}  // namespace
}  // namespace metastable::analysis::test
