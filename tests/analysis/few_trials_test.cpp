// What a diagnosis may say of a handful of trials.

#include <gtest/gtest.h>

#include "analysis/diagnosis.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

Diagnosis without_gap(std::size_t trials, std::size_t collisions, std::uint64_t seed) {
  const auto design = wheel_transitions(test::wheel_design(trials, collisions));
  DiagnosisOptions options;
  options.draws = 300;
  return diagnose(*design->simulate(test::nominal(*design), {}, seed), options);
}

// Where chance was drawn from the trials' own scores, nearly every experiment of one to three trials had a gap, and
// every other one of a hundred trials of one collision.
TEST(FewTrials, AreNotTakenForAGap) {
  int alarms = 0;
  for (const auto& [trials, collisions] : {std::pair{1, 2}, {2, 10}, {3, 6}, {5, 3}, {100, 1}})
    for (std::uint64_t seed = 1; seed <= 2; ++seed)
      alarms +=
          without_gap(static_cast<std::size_t>(trials), static_cast<std::size_t>(collisions), seed).p_value < 0.04;
  EXPECT_LE(alarms, 2);  // of 10, each with 4 %
}

}  // namespace
}  // namespace metastable::analysis
