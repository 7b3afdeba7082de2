#include "analysis/diagnosis/diagnosis_sentences.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {
namespace {

std::string said_at_work(double alone, double beside) {
  Diagnosis d;
  d.verdict = Verdict::explained;
  AtWork one;
  one.name = "a_by_phase";
  one.effects = {"a_by_phase"};
  one.probability = 1;
  one.closes_alone = Estimate{alone, alone, alone};
  one.closes_beside = Estimate{beside, beside, beside};
  d.causes.at_work = {one};
  d.causes.set = {"a_by_phase"};
  Cause cause;
  cause.effects = {"a_by_phase"};
  d.causes.ranked = {cause};
  const std::vector<std::string> all = sentences(d);
  const auto at = std::ranges::find_if(all, [](const std::string& s) { return s.starts_with("At work"); });
  return at == all.end() ? "" : *at;
}

TEST(DiagnosisSentences, SayWhatAnEffectClosesBesideOtherParameters) {
  EXPECT_EQ(said_at_work(0.97, 0.12), "At work with probability 1.00: a_by_phase; it closes 97 % of the gap.");
  EXPECT_EQ(said_at_work(-0.01, 0.25),
            "At work with probability 1.00: a_by_phase; it closes less than 1 % of the gap in the model as given, 25 % "
            "when it is added to the recalibrated model.");
}

TEST(DiagnosisSentences, SayWhatStandsInThePlaceOfTheUnnamed) {
  Diagnosis d;
  d.verdict = Verdict::partly_explained;
  d.data.step_name = "collision";
  d.causes.p_unnamed = 0.93;
  d.causes.unnamed_share = 0.108;
  const auto stays = [&] {
    std::string said;
    for (const std::string& sentence : sentences(d))
      if (sentence.find("without a name") < 20 || sentence.starts_with("The likeliest model has")) said += sentence;
    return said;
  };
  EXPECT_EQ(stays(), "Something without a name stays, 11 % of the gap, with probability 0.93.");
  d.causes.stand_ins = {"contact_memory", "trial_spread"};
  EXPECT_EQ(stays(),
            "Something without a name is at work, too, 11 % of the gap, with probability 0.93."
            "The likeliest model has contact_memory and trial_spread in the place of what has no name, too unlikely to "
            "be named.");
}

std::string next_for(std::size_t trials, std::size_t steps, const std::string& step_name) {
  Diagnosis d;
  d.verdict = Verdict::unexplained;
  d.data.trials = trials;
  d.data.collisions = steps;
  d.data.step_name = step_name;
  return next_step(d);
}

TEST(DiagnosisSentences, OneLongTrialMayBeCut) {
  EXPECT_NE(
      next_for(1, 244, "step").find("or cut long ones: a trial number of its own for every 24 rows makes about 10."),
      std::string::npos)
      << next_for(1, 244, "step");
  for (const std::string& uncut :
       {next_for(1, 244, "collision"), next_for(1, 244, "revolution"), next_for(1, 43, "step")})
    EXPECT_NE(uncut.find("trials like these, and diagnose them together."), std::string::npos) << uncut;
  EXPECT_NE(next_for(10, 30, "step").find("Run 14 trials like these, or longer ones,"), std::string::npos)
      << next_for(10, 30, "step");
}

}  // namespace
}  // namespace metastable::analysis
