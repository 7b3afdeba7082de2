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

// Of two geometric lifetimes, failure 0.5 and 0.25 a step, seen for 2 collisions, min(T, 3) is 1, 2, 3.
TEST(Comparison, TrialsToTellApartAreOfStepsWithinTheCollisions) {
  const std::vector<double> a{1, 0.5, 0.25}, b{1, 0.75, 0.5625};
  const auto design = trials_to_tell_apart(a, b, 2),
             by_hand = trials_for_power({0, 0.5, 0.25, 0.25}, {0, 0.25, 0.1875, 0.5625});
  EXPECT_EQ(design->trials, by_hand->trials);
  EXPECT_EQ(design->power, by_hand->power);
  EXPECT_FALSE(trials_to_tell_apart(a, a, 2));
  EXPECT_THROW(trials_to_tell_apart(a, b, 3), std::invalid_argument);
}

TEST(Comparison, FewerStepsAreSaidSo) {
  Setting smooth = paper_setting(7.02, true);
  smooth.restitution.sd = smooth.friction.sd = 0.05;
  const Contrast contrast = compare({smooth, paper_setting(7.02, true)}, {.cells = 64, .samples = 1024}).contrasts[0];
  EXPECT_NE(contrast.sentence.find("eta 0.4 sd"), 0u);
  EXPECT_EQ(contrast.sentence.find("sd of eta 0.1, sd of mu 0.1 takes 0."), 0u) << contrast.sentence;
  EXPECT_NE(contrast.sentence.find(" fewer ("), std::string::npos) << contrast.sentence;
  EXPECT_EQ(contrast.sentence.find("-"), std::string::npos) << contrast.sentence;
}

// One side has replicates of a chain, the other takes seven steps for certain.
TEST(Comparison, AWheelWithoutNoiseBesideOneWithIt) {
  Setting plastic = paper_setting(7.02, true);
  plastic.law = dynamics::Law::plastic;
  plastic.slope_deg = 2;
  plastic.initial_speed.sd = 0;
  Setting noisy = paper_setting(7.02, true);
  const Comparison comparison = compare({plastic, noisy}, {.cells = 64, .samples = 1024});
  const double certain = comparison.studies[0].steps.from_start.value;
  EXPECT_EQ(certain, std::round(certain));
  const Estimate &steps = comparison.studies[1].steps.from_start, &ratio = *comparison.contrasts[0].ratio;
  EXPECT_DOUBLE_EQ(ratio.value, steps.value / certain);
  EXPECT_NEAR(ratio.upper / ratio.value, steps.upper / steps.value, 1e-3);
}

TEST(Comparison, NeedsTwoSettings) { EXPECT_THROW(compare({paper_setting(7.02, true)}, {}), std::invalid_argument); }

}  // namespace
}  // namespace metastable::analysis
