#include "analysis/statistics/kaplan_meier.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/stand_in.h"

namespace metastable::analysis {
namespace {

// Returns Freireich et al. (1963), 6-MP arm, weeks to relapse (+: censored); survival and standard errors as tabulated
// in Kalbfleisch and Prentice, "The Statistical Analysis of Failure Time Data".
std::vector<ObservedSteps> six_mp() {
  std::vector<ObservedSteps> trials;
  for (const int t : {6, 6, 6, 7, 10, 13, 16, 22, 23}) trials.push_back({t, true});
  for (const int t : {6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35}) trials.push_back({t, false});
  return trials;
}

TEST(KaplanMeier, GivesTheSixMpArm) {
  const auto points = kaplan_meier(six_mp());
  struct Row {
    int weeks;
    double survival, error;
  };
  for (const Row& row : {Row{6, 0.8571, 0.0764},
                         {7, 0.8067, 0.0869},
                         {10, 0.7529, 0.0963},
                         {13, 0.6902, 0.1068},
                         {16, 0.6275, 0.1141},
                         {22, 0.5378, 0.1282},
                         {23, 0.4482, 0.1346}}) {
    const SurvivalPoint& point = points[static_cast<std::size_t>(row.weeks) - 1];
    EXPECT_EQ(point.steps, row.weeks);
    EXPECT_NEAR(point.survival, row.survival, 5.1e-5);
    EXPECT_NEAR(point.standard_error, row.error, 5.1e-5);
    EXPECT_LT(point.lower, point.survival);
    EXPECT_GT(point.upper, point.survival);
  }
  // In R it is survfit(..., conf.type = "log-log") at week 23.
  EXPECT_NEAR(points[22].lower, 0.188, 5e-4);
  EXPECT_NEAR(points[22].upper, 0.680, 5e-4);
}

TEST(KaplanMeier, WithoutCensoringIsTheEmpiricalShare) {
  const std::vector<ObservedSteps> trials = {{2, true}, {4, true}, {4, true}, {7, true}};
  const auto points = kaplan_meier(trials);
  EXPECT_DOUBLE_EQ(points[1].survival, 0.75);
  EXPECT_DOUBLE_EQ(points[3].survival, 0.25);
  EXPECT_DOUBLE_EQ(points[6].survival, 0);
  EXPECT_DOUBLE_EQ(points[1].standard_error, std::sqrt(0.75 * 0.25 / 4));
  const ExpectedSteps expected = expected_steps(trials, 20, 1);
  EXPECT_DOUBLE_EQ(expected.from_start.value, 17.0 / 4);
  EXPECT_FALSE(expected.message.empty());
}

TEST(KaplanMeier, SaysWhereThereIsOnlyABound) {
  const std::vector<ObservedSteps> trials(50, {16, false});
  EXPECT_NEAR(kaplan_meier(trials)[15].lower, std::pow(0.025, 1.0 / 50), 1e-12);
  const ExpectedSteps expected = expected_steps(trials, 13, 1);
  EXPECT_TRUE(std::isinf(expected.from_start.value));
  EXPECT_GT(expected.from_start.lower, 60);
  EXPECT_NEAR(expected.failure_rate.upper, 1 - std::pow(0.025, 1.0 / 200), 1e-9);
  EXPECT_THROW(kaplan_meier({}), std::invalid_argument);
  EXPECT_THROW(kaplan_meier(std::vector<ObservedSteps>{{0, true}}), std::invalid_argument);
}

// At a rate of 2 in 200 collisions e^-2 = 13 % of experiments see no rest, and their bound of 95 % has to hold: 12
// steps and one over the rate, of which 0.05 of experiments see none.
TEST(KaplanMeier, BoundWithoutARestIsExact) {
  const double exact = 12 + 1 / (1 - std::pow(0.05, 1.0 / 200));
  EXPECT_NEAR(expected_steps(std::vector<ObservedSteps>(50, {16, false}), 13, 1).from_start.lower, exact, 0.04 * exact);
}

// The stand-in's wheel takes at 7.02 deg 194.95 expected steps (`metastable steps`, interval 194.63 to 195.27).
TEST(KaplanMeier, IntervalsCoverTheChainsExpectedSteps) {
  Setting setting = stand_in_setting();
  int covered = 0;
  constexpr int experiments = 60;
  for (std::uint64_t e = 0; e < experiments; ++e) {
    std::vector<ObservedSteps> trials;
    for (const dynamics::Trial& trial :
         simulate_trials(setting, {.trials = 50, .collisions = 31, .seed = 7, .first = 50 * e}))
      trials.push_back({static_cast<int>(trial.collisions.size()), trial.outcome == dynamics::Outcome::rest});
    const ExpectedSteps expected = expected_steps(trials, 13, e);
    covered += expected.from_start.lower <= 194.95 && 194.95 <= expected.from_start.upper;
  }
  EXPECT_GE(covered, 53);  // 57 expected, sd 1.7
}

}  // namespace
}  // namespace metastable::analysis
