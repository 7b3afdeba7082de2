#include "analysis/fitting/effect_fit.h"

#include <gtest/gtest.h>

#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::line;

TEST(EffectFit, TakesLessEffortWhereScoresScatterFarMoreThanTheyShould) {
  const auto model = line(0, 5, 2000);
  Fit recalibrated = fit(model, {0, 0}, {});
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
  for (double& score : recalibrated.evaluation.score) score *= 1.05;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
  for (double& score : recalibrated.evaluation.score) score *= 1.3;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, 1U);
}

TEST(EffectFit, TakesAllItsTimeOverFewEvents) {
  const auto model = line(0, 5, 300);
  Fit recalibrated = fit(model, {0, 0}, {});
  for (double& score : recalibrated.evaluation.score) score *= 2;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
}

}  // namespace
}  // namespace metastable::analysis
