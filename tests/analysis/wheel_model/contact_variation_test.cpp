#include "analysis/wheel_model/contact_variation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/gap/fitted_variations.h"
#include "analysis/wheel_model/wheel_transitions.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

const Variation& variation(const TransitionModel& model, const std::string& id) {
  const auto found =
      std::ranges::find_if(model.variations(), [&](const Variation& one) { return one.candidate.id == id; });
  if (found == model.variations().end()) throw std::invalid_argument("no variation " + id);
  return *found;
}

// Fits find variations of the size that the data were drawn with, and the likeliest one is theirs.
TEST(ContactVariation, FitsFindWhatTheDataWereDrawnWith) {
  const auto design = wheel_transitions(test::wheel_design(100, 14));
  struct Case {
    const char* id;
    std::vector<double> variant, values;
  };
  const std::vector<Case> cases{{"mean friction by order", {4}, {0, 0.06}},
                                {"mean restitution by order", {7}, {0.07, 0}},
                                {"mean friction by every other trial", {}, {0.05}},
                                {"scatter of friction by position", {}, {0.4}}};
  for (const Case& one : cases) {
    const Variation& truth = variation(*design, one.id);
    const std::vector<EffectTerm> terms{{&truth.candidate, one.variant, one.values}};
    const auto data = design->simulate(nominal_values(*design), terms, 5);
    const Fit without = best_fit(*data, nominal_values(*data), {});
    std::vector<EffectTerm> start = terms;
    for (double& value : start[0].values) value *= 0.8;
    const Fit with = fit(*data, without.nuisance, start);
    EXPECT_TRUE(with.converged) << one.id;
    EXPECT_GT(with.penalised, without.penalised + 10) << one.id;
    for (std::size_t p = 0; p < one.values.size(); ++p)
      EXPECT_NEAR(with.terms[0].values[p], one.values[p], 0.03 + 0.3 * one.values[p]) << one.id;
    const std::vector<LeftInFacet> all =
        fitted_variations(*data, without, scan_variations(*data, without, 1), Rules{}, 1, [] {});
    const auto best = std::ranges::max_element(all, {}, &LeftInFacet::evidence);
    EXPECT_EQ(best->aspect + " by " + best->facet, one.id);
    EXPECT_NEAR(best->quadratic, 2 * (with.penalised - without.penalised), 1) << one.id;
  }
}

// Where nothing varies, none of them has evidence.
TEST(ContactVariation, NoneHasEvidenceWhereNothingVaries) {
  const auto design = wheel_transitions(test::wheel_design(100, 14));
  const auto data = design->simulate(nominal_values(*design), {}, 6);
  const Fit best = best_fit(*data, nominal_values(*data), {});
  const EffectScan scan = scan_variations(*data, best, 1);
  EXPECT_GT(variations_p_value(scan, promised_gains(scan), 500, 1), 0.05);
  const std::vector<LeftInFacet> all = fitted_variations(*data, best, scan, Rules{}, 1, [] {});
  EXPECT_EQ(all.size(), data->variations().size());
  for (const LeftInFacet& one : all) EXPECT_LT(one.evidence, 5) << one.aspect << " by " << one.facet;
}

// The clock runs from a trial's first collision, and what is gained is gained since the one before.
TEST(ContactVariation, PlacesKnowClockAndChangeOfSpeed) {
  WheelRun run;
  run.collisions.resize(3);
  for (std::size_t k = 0; k < 3; ++k) run.collisions[k].before = 5 + 0.5 * static_cast<double>(k);
  run.collisions[1].context.since_previous = 0.2;
  run.collisions[2].context.since_previous = 0.3;
  const CollisionPlace first = collision_place(run, 4, 0, run.collisions[0], 5);
  EXPECT_EQ(first.clock, 0);
  EXPECT_EQ(first.gained, 0);
  EXPECT_EQ(first.gained_before, 0);
  EXPECT_EQ(first.number, 1);
  const CollisionPlace third = collision_place(run, 4, 2, run.collisions[2], 6);
  EXPECT_DOUBLE_EQ(third.clock, 0.5);
  EXPECT_DOUBLE_EQ(third.gained, 0.5);
  EXPECT_DOUBLE_EQ(third.gained_before, 0.5);
  EXPECT_EQ(third.trial, 4U);
}

}  // namespace
}  // namespace metastable::analysis
