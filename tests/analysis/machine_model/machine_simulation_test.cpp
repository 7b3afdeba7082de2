// Runs that are drawn under a hypothesis have normal scores under it: simulation and likelihood mean the same.

#include "analysis/machine_model/machine_simulation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_effects.h"
#include "analysis/machine_model/machine_filter.h"
#include "analysis/machine_model/machine_variations.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

MachineRuns measured() {
  MachineRuns runs =
      scalar_runs(150, 25, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  runs.phases = {"left", "right"};
  for (MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k < trial.rows.size(); ++k) trial.rows[k].phase = static_cast<int>(k % 2);
  return runs;
}

TEST(MachineSimulation, DrawnRunsHaveNormalScores) {
  const Machine machine = linear_machine(0.1, -0.5);
  const MachineRuns runs = measured();
  MachineHypothesis h = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, h);
  h.memory = {0.4};
  h.spreads = {{1, 0.1}};
  h.bias = {0.2};
  h.added_noise = {0.05};
  h.scatter.assign(runs.trials.size() * 25, 1.0);
  for (std::size_t i = 0; i < h.scatter.size(); i += 2) h.scatter[i] = 2;
  const MachineRuns drawn = simulate_machine(machine, runs, h, 9);
  const Evaluation evaluation = follow_machine(machine, drawn, plan, machine_events(machine, drawn, plan), h);
  ASSERT_EQ(evaluation.score.size(), 150u * 24);
  EXPECT_LT(kolmogorov(evaluation.score), 1.63);  // 1 % of normal samples exceed it
  double next = 0, square = 0;
  for (std::size_t i = 1; i < evaluation.score.size(); ++i) next += evaluation.score[i] * evaluation.score[i - 1];
  for (const double score : evaluation.score) square += score * score;
  EXPECT_LT(std::abs(next), 3.3 * std::sqrt(3600.0));               // successive scores know nothing of each other
  EXPECT_LT(std::abs(square - 3600), 3.3 * std::sqrt(2 * 3600.0));  // nor are they wider or narrower
}

TEST(MachineSimulation, ATrialThatOutlivesItsOriginalGoesOnPhaseByPhase) {
  MachineRuns runs = measured();
  const Machine machine = linear_machine(0.1);
  runs.trials[2].rows.resize(4);
  runs.trials[2].outcome = MachineOutcome::failed;
  const MachineTrial drawn = simulate_machine(machine, runs, nominal_of(machine), 1).trials[2];
  ASSERT_EQ(drawn.rows.size(), 25u);
  EXPECT_EQ(drawn.outcome, MachineOutcome::stopped);
  for (std::size_t k = 0; k < drawn.rows.size(); ++k) EXPECT_EQ(drawn.rows[k].phase, static_cast<int>(k % 2)) << k;
}

// No effect that these runs can show, and no variation, leaves the reach of the likelihood.
TEST(MachineSimulation, EveryEffectHasALikelihood) {
  const Machine machine = linear_machine(0.1);
  const MachineRuns runs = measured();
  const MachineHypothesis nominal = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, nominal);
  const std::vector<Event> events = machine_events(machine, runs, plan);
  const auto design = std::make_shared<MachineDesign>(machine_design(machine, runs));
  const auto check = [&](const auto& one, const Candidate& candidate) {
    if (!candidate.undecidable.empty()) return;
    std::vector<double> values;
    for (const FreeParameter& p : candidate.parameters) values.push_back(p.neutral + 10 * p.step);
    MachineHypothesis h = nominal;
    one.apply(h, candidate.variants.front(), values);
    EXPECT_GT(follow_machine(machine, runs, plan, events, h).total(), -1e5) << candidate.id;
  };
  for (const MachineCandidate& one : machine_effects(machine, design)) check(one, one.candidate);
  for (const MachineVariation& one : machine_variations(machine, design)) check(one, one.variation.candidate);
}

// The rare one of two values of a label is said to differ, whichever comes first: the parameter's stated value is that
// of most steps, so that what is known of it does not pull at the size.
TEST(MachineEffects, TheRarerOfTwoValuesIsTheOneThatDiffers) {
  const Machine machine = linear_machine(0.1);
  for (const bool second_is_rare : {true, false}) {
    MachineRuns runs = measured();
    runs.labels = {{"floor", {"dry", "wet"}}};
    for (MachineTrial& trial : runs.trials)
      for (std::size_t k = 0; k < trial.rows.size(); ++k)
        trial.rows[k].labels = {(k % 5 == 0) == second_is_rare ? 1 : 0};
    const auto effects = machine_effects(machine, std::make_shared<MachineDesign>(machine_design(machine, runs)));
    const auto found = std::ranges::find(effects, "b_by_floor", [](const auto& one) { return one.candidate.id; });
    ASSERT_NE(found, effects.end());
    ASSERT_EQ(found->candidate.variants.size(), 1u);
    EXPECT_EQ(found->candidate.report(found->candidate.variants[0], {0.1})[0].first,
              second_is_rare ? "change_in_wet" : "change_in_dry");
  }
}

TEST(MachineSimulation, ExperimentsDrawnTogetherAreThoseDrawnAlone) {
  const Machine machine = linear_machine(0.1, -0.5);
  const MachineRuns runs = measured();
  MachineHypothesis h = nominal_of(machine);
  h.memory = {0.4};
  h.changes = {{1, std::vector<double>(runs.trials.size() * 25, 0.0)}};
  for (std::size_t i = 0; i < h.changes[0].transition.size(); i += 3) h.changes[0].transition[i] = 0.5;
  const std::vector<std::uint64_t> seeds{9, 10, 31};
  std::vector<MachineRuns> launched;
  for (const std::uint64_t seed : seeds) launched.push_back(smoothed_launches(runs, h, seed));
  const std::vector<MachineRuns> together = simulate_machines(machine, launched, h, seeds);
  ASSERT_EQ(together.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const MachineRuns alone = simulate_machine(machine, launched[i], h, seeds[i]);
    ASSERT_EQ(together[i].trials.size(), alone.trials.size());
    for (std::size_t t = 0; t < alone.trials.size(); ++t) {
      ASSERT_EQ(together[i].trials[t].rows.size(), alone.trials[t].rows.size());
      for (std::size_t k = 0; k < alone.trials[t].rows.size(); ++k)
        EXPECT_EQ(together[i].trials[t].rows[k].seen, alone.trials[t].rows[k].seen) << i << " " << t << " " << k;
    }
  }
}

// Whatever was measured, the state that the map lacks follows the state that is drawn.
TEST(MachineSimulation, CarriesAStateThatTheMapLacks) {
  Machine machine = linear_machine(0);
  MachineHypothesis h = nominal_of(machine);
  machine.parameters[2].lower = h.values[2] = 0;  // no noise
  MachineRuns runs;
  runs.trials.resize(1);
  for (int k = 0; k < 20; ++k) runs.trials[0].rows.push_back({{2.0 + k}});
  std::vector<double> ahead(19, 100.0);
  ahead[0] = 0.5;
  h.hidden = {{0, 0, 0.9, 0.2, ahead}};
  const MachineRuns drawn = simulate_machine(machine, runs, h, 1);
  double x = 2, hidden = 2.5;
  for (const MachineRow& row : drawn.trials[0].rows) {
    EXPECT_NEAR(row.seen[0], x, 1e-9);
    const double apart = hidden - x;
    x = 0.8 * x + 0.3 + 0.2 * apart;
    hidden -= 0.1 * apart;
  }
}

}  // namespace
}  // namespace metastable::analysis::test
