#include "analysis/diagnosis/verdict.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "analysis/diagnosis/diagnosis_sentences.h"

namespace metastable::analysis {
namespace {

// One effect, and something without a name; the rest is recalibration's.
Diagnosis with_odds_of_none(double none) {
  Diagnosis d;
  Cause cause;
  cause.effects = {"friction_patch"};
  cause.parameters.emplace_back();
  cause.probability = 0.9 / (1 + none);
  d.causes.ranked = {cause};
  d.causes.p_none = none * cause.probability;
  give_verdict(d, true, none, cause.probability);
  return d;
}

TEST(Verdict, ANameIsGivenWhereItIsFourTimesAsLikelyAsNone) {
  EXPECT_EQ(with_odds_of_none(0.2).verdict, Verdict::explained);
  EXPECT_EQ(with_odds_of_none(0.2).causes.set, std::vector<std::string>{"friction_patch"});
  EXPECT_EQ(with_odds_of_none(0.3).verdict, Verdict::unexplained);
  EXPECT_TRUE(with_odds_of_none(0.3).causes.set.empty());
}

TEST(Verdict, SaysThatTheNearestIsTooUnsureForAName) {
  const auto first_sentence = [](double none) { return sentences(with_odds_of_none(none)).front(); };
  EXPECT_EQ(
      first_sentence(0.5),
      "There is a gap that recalibration does not remove. The nearest of the catalogue is friction_patch; that it "
      "is none of the catalogue has probability 0.30, too much for a name.");
  EXPECT_EQ(first_sentence(4),
            "There is a gap that no effect of the catalogue, nor a pair, removes: something else is at work.");
}

}  // namespace
}  // namespace metastable::analysis
