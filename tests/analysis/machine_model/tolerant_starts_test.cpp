// An effect that moves nearly every row far off is found.

#include "analysis/machine_model/tolerant_starts.h"

#include <gtest/gtest.h>

#include "analysis/fitting/model_fit.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/walker_model/walk_folder.h"

namespace metastable::analysis::test {
namespace {

// @param wild  every so many trials one row is off by a tenth of a radian
std::unique_ptr<TransitionModel> compass_walks(double hip_damping, std::size_t wild = 0) {
  const WalkFiles drawn =
      draw_walks({Walker::compass, 3, 0.4, dynamics::Terrain::fresh}, {{"hip_damping.damping", hip_damping}},
                 {.trials = 12, .longest = 8, .seed = 3}, "walks");
  auto walks = parse_walks(source_of(drawn, "walks"));
  for (std::size_t t = 0; wild > 0 && t < walks->runs.trials.size(); t += wild)
    walks->runs.trials[t].rows[4].seen[0] += 0.1;
  return machine_transitions(walks->machine, walks->runs);
}

EffectTerm damping_of(const TransitionModel& model) {
  for (const Candidate& candidate : model.candidates())
    if (candidate.id == "hip_damping") return {&candidate, candidate.variants[0], {0}};
  return {};
}

TEST(TolerantStarts, LeadToAnEffectThatMovesNearlyEveryRowFarOff) {
  const auto model = compass_walks(0.1);
  const Fit recalibrated = best_fit(*model, nominal_values(*model), {}, {});
  const std::vector<EffectTerm> damping{damping_of(*model)};
  ASSERT_EQ(model->starts(damping).size(), 1u);
  const Fit found = best_fit(*model, recalibrated.nuisance, damping, {});
  EXPECT_NEAR(found.terms[0].values[0], 0.1, 0.005);
  EXPECT_GT(found.log_likelihood, recalibrated.log_likelihood + 500);
}

TEST(TolerantStarts, AreNotNeededWhereTheModelHolds) {
  const auto model = compass_walks(0);
  EXPECT_TRUE(model->starts({}).empty());
  EXPECT_TRUE(model->starts(std::vector{damping_of(*model)}).empty());
}

TEST(TolerantStarts, DoNotReplaceAFitThatTakesBadRowsForWild) {
  const auto model = compass_walks(0, 3);
  ASSERT_EQ(model->starts({}).size(), 1u);  // a twentieth of the rows: more than may be wild
  const Fit usual = fit(*model, nominal_values(*model), {});
  EXPECT_GT(best_fit(*model, nominal_values(*model), {}, {}).penalised, usual.penalised - 0.1);
}

}  // namespace
}  // namespace metastable::analysis::test
