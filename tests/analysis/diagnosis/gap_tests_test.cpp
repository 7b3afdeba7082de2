#include "analysis/diagnosis/gap_tests.h"

#include <gtest/gtest.h>

#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/gap/facet_evidence.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

// Returns the tests where effects and cells show nothing, and so much is left by facet.
Diagnosis::Gap tests_of(const std::vector<LeftInFacet>& facets) {
  CauseRanking ranking;
  ranking.scan.trials_suffice = true;
  Diagnosis::Gap gap;
  put_together(gap, {.effects = 0.5, .where = 0.5, .facets = facets_p_value(ranking, facets)}, Rules{});
  return gap;
}

// A model as given that is so far off that its likelihood has no slope gains all the same.
TEST(GapTests, ARecalibrationCountsWhereTheModelAsGivenHasNoSlope) {
  const test::Line line({1, 2, 3, 4}, {0, 0, 0, 0});
  Fit as_given;
  as_given.information = Eigen::MatrixXd::Zero(2, 2);
  for (Eigen::Index p = 0; p < 2; ++p)
    as_given.information(p, p) = line.nuisances()[static_cast<std::size_t>(p)].information(0);
  EXPECT_LT(recalibration_p_value(line, as_given, 100), 1e-12);
  EXPECT_NEAR(recalibration_p_value(line, as_given, 0), 1, 1e-12);
}

TEST(GapTests, AFitThatDidNotSettleLeavesNoFacetToJudge) {
  const Diagnosis::Gap gap = tests_of({});
  EXPECT_EQ(gap.p_facets, 1);
  EXPECT_GT(gap.p_value, 0.1);
}

TEST(GapTests, TheLeastOfTheFacetsCountsForAllOfThem) {
  LeftInFacet usual, far;
  usual.p_value = 0.3;
  far.p_value = 1e-6;
  EXPECT_DOUBLE_EQ(tests_of({usual, far, usual}).p_facets, 3e-6);
  EXPECT_LT(tests_of({usual, far, usual}).p_value, 1e-4);
  EXPECT_EQ(tests_of({usual}).p_facets, 0.3);
}

TEST(GapTests, WhatVariesWithoutANameIsAGap) {
  Diagnosis::Gap gap;
  put_together(gap, {.effects = 0.5, .where = 0.5, .variations = 1e-9}, Rules{});
  EXPECT_LT(gap.p_value, 1e-7);
}

// The shares of the level add up to it, and pairs come on top.
TEST(GapTests, SharesKeepTheLevel) {
  const Rules rules;
  EXPECT_NEAR(rules.share_for_effects + 3 * rules.share_for_unnamed(), 1, 1e-12);
}

}  // namespace
}  // namespace metastable::analysis
