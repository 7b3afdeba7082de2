#include "analysis/sensitivity/comparison.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

TEST(Comparison, RatioOfThePapersRampsOnCommonNumbers) {
  const Comparison comparison = compare({paper_setting(7.02, true), paper_setting(9.59, true)}, {});
  ASSERT_EQ(comparison.contrasts.size(), 1u);
  const Contrast& contrast = comparison.contrasts.front();
  ASSERT_TRUE(contrast.ratio && contrast.difference && contrast.trials_needed);
  EXPECT_LE(contrast.ratio->lower, 6.1746 / 4.2585);
  EXPECT_GE(contrast.ratio->upper, 6.1746 / 4.2585);
  EXPECT_NEAR(contrast.difference->value, 6.1746 - 4.2585, 0.02);
  EXPECT_EQ(comparison.studies[0].samples, comparison.studies[1].samples);
  EXPECT_EQ(comparison.studies[0].cells, comparison.studies[1].cells);
}

TEST(Comparison, ASettingAgainstItselfDiffersByNothing) {
  const Comparison comparison =
      compare({paper_setting(7.02, true), paper_setting(7.02, true)}, {.cells = 64, .samples = 1024});
  EXPECT_DOUBLE_EQ(comparison.contrasts[0].ratio->value, 1.0);
  // With common random numbers nothing is left but the discretization errors.
  EXPECT_NEAR(comparison.contrasts[0].ratio->upper, std::exp(2 * comparison.studies[0].steps.discretization_error),
              1e-9);
  EXPECT_FALSE(comparison.contrasts[0].trials_needed);
}

TEST(Comparison, NoRatioWhereOneSideIsInfinite) {
  Setting endless = paper_setting(9.59, true);
  endless.law = dynamics::Law::coulomb;
  const Comparison comparison = compare({paper_setting(7.02, true), endless}, {.cells = 64, .samples = 1024});
  const Contrast& contrast = comparison.contrasts.front();
  EXPECT_FALSE(contrast.ratio);
  EXPECT_FALSE(contrast.difference);
  EXPECT_NE(contrast.sentence.find("infinite: rest is unreachable"), std::string::npos);
  EXPECT_NE(contrast.sentence.find("no ratio"), std::string::npos);
  EXPECT_TRUE(contrast.trials_needed);  // trials that rest tell it from one that does not
}

// Of two geometric lifetimes, failure 0.5 and 0.25 a step, seen for 2 collisions, min(T, 3) has means 1.75 and 2.3125.
TEST(Comparison, TrialsToTellApartByHand) {
  const std::vector<double> a{1, 0.5, 0.25}, b{1, 0.75, 0.5625};
  const double var_a = (1 + 3 * 0.5 + 5 * 0.25) - 1.75 * 1.75, var_b = (1 + 3 * 0.75 + 5 * 0.5625) - 2.3125 * 2.3125;
  const double reach = 1.959963984540054 + 0.8416212335729143;
  EXPECT_EQ(*trials_to_tell_apart(a, b, 2), std::ceil(reach * reach * (var_a + var_b) / (0.5625 * 0.5625)));
  EXPECT_FALSE(trials_to_tell_apart(a, a, 2));
  EXPECT_THROW(trials_to_tell_apart(a, b, 3), std::invalid_argument);
}

TEST(Comparison, NeedsTwoSettings) { EXPECT_THROW(compare({paper_setting(7.02, true)}, {}), std::invalid_argument); }

}  // namespace
}  // namespace metastable::analysis
