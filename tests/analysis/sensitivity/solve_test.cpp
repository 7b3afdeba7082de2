#include "analysis/sensitivity/solve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

using Of = Target::Of;

// Expected steps exp(at), known to one per cent.
Answered exponential(double at, int) { return {{std::exp(at), 0.99 * std::exp(at), 1.01 * std::exp(at)}, ""}; }

TEST(Solve, InvertsAClosedFormWithItsInterval) {
  const Solution found = solve(exponential, {Of::steps, 1e4, 0}, {0, 20, false}, {});
  ASSERT_EQ(found.found.size(), 1U);
  EXPECT_NEAR(found.found[0].at.value, std::log(1e4), 1e-4);
  EXPECT_NEAR(found.found[0].at.lower, std::log(1e4 / 1.01), 3e-4);
  EXPECT_NEAR(found.found[0].at.upper, std::log(1e4 / 0.99), 3e-4);
  EXPECT_EQ(found.scanned.size(), 17U);
  EXPECT_NEAR(found.scanned[4].answer.quantity.value, std::exp(5.0), 1e-6 * std::exp(5.0));
  EXPECT_EQ(found.sentences().size(), 1U);
}

TEST(Solve, InvertsAProbability) {
  // From the regime of that rate, 1000 steps are survived by exp(-1000 rate).
  const auto survival = [](double at, int) {
    const Estimate steps{std::exp(at), 0.99 * std::exp(at), 1.01 * std::exp(at)};
    return Answered{probability(std::exp(-1000 / steps.value), steps), ""};
  };
  const Solution found = solve(survival, {Of::survival, 0.9, 1000}, {0, 20, false}, {});
  ASSERT_EQ(found.found.size(), 1U);
  EXPECT_NEAR(found.found[0].at.value, std::log(-1000 / std::log(0.9)), 1e-4);
  EXPECT_NEAR(found.found[0].at.upper - found.found[0].at.lower, std::log(1.01 / 0.99), 1e-3);
}

TEST(Solve, SaysWhatIsOutOfReach) {
  const Solution none = solve(exponential, {Of::steps, 1e4, 0}, {0, 5, false}, {});
  EXPECT_TRUE(none.found.empty());
  EXPECT_EQ(none.sentences(), std::vector<std::string>{"out of reach between 0 and 5: 1 steps at 0 to 148 steps at 5"});
}

TEST(Solve, CannotVouchForWhatHasNoAnswer) {
  const auto gaps = [](double at, int) { return at > 4 ? Answered{{}, "the solver failed"} : exponential(at, 1); };
  EXPECT_NE(message_of<std::runtime_error>([&] {
              solve(gaps, {Of::steps, 1e4, 0}, {0, 20, false}, {});
            }).find("the solver failed"),
            std::string::npos);
  const Solution below = solve(gaps, {Of::steps, 10, 0}, {0, 20, false}, {});
  ASSERT_EQ(below.found.size(), 1U);
  EXPECT_NE(below.sentences().back().find("not known at 5: the solver failed"), std::string::npos);
}

TEST(Solve, GivesTheParameterWhoseStudyHasTheSteps) {
  const Setting base = paper_setting(7.02, true);
  const StudyOptions study_options{.method = Method::integrated};
  for (const Parameter parameter : {Parameter::friction_mean, Parameter::friction_sd}) {
    const Solution found = solve(base, parameter, {Of::steps, 20, 0}, {.points = 9}, study_options);
    ASSERT_FALSE(found.found.empty()) << parameter_name(parameter);
    for (const Crossing& one : found.found) {
      Setting setting = base;
      set_parameter(setting, parameter, one.at.value);
      EXPECT_NEAR(study(setting, study_options).steps.from_start.value, 20, 0.2) << parameter_name(parameter);
      EXPECT_LE(one.at.lower, one.at.value);
      EXPECT_GE(one.at.upper, one.at.value);
    }
  }
}

TEST(Solve, ReachesTheRampsEndAsTheStudySays) {
  const Setting base = paper_setting(7.02, true);
  const StudyOptions study_options{.method = Method::integrated};
  const Solution found = solve(base, Parameter::friction_mean, {Of::ramp_end, 0.5, 0}, {.points = 9}, study_options);
  ASSERT_EQ(found.found.size(), 1U);
  Setting setting = base;
  set_parameter(setting, Parameter::friction_mean, found.found[0].at.value);
  EXPECT_NEAR(*study(setting, study_options).steps.reach_end, 0.5, 0.005);
  EXPECT_FALSE(found.found[0].rising);
}

// Ten million trials of these formulas in NumPy survive three steps 51.833 % of the time (standard error 0.016).
TEST(Solve, HasIntervalsOfSurvivalThatHoldWhatTrialsDo) {
  const double simulated = 0.51833, error = 0.00016;
  Problem problem = paper_setting(7.02, true).problem();
  problem.last_event = 3;
  int held = 0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Metastability found =
        study(problem, {.cells = 64, .samples = 256, .seed = seed, .brief = true, .reach_end_interval = true});
    ASSERT_TRUE(found.steps.reach_end_interval);
    const Estimate& survival = *found.steps.reach_end_interval;
    EXPECT_EQ(survival.value, *found.steps.reach_end);
    EXPECT_LT(survival.upper - survival.lower, 0.03);
    held += survival.lower - 2 * error < simulated && simulated < survival.upper + 2 * error;
  }
  EXPECT_GE(held, seeds - 2);
}

// `metastable steps --slope 8.214 --legs 0.1519 --friction 0.3,0.05 --json -` has a failure rate r of 1.054e-4 from the
// regime that it starts in, and (1 - r)^1000 = 0.9.
TEST(Solve, FindsTheSlopeThatNinetyPerCentSurvive) {
  Setting base = paper_setting(7.02, true);
  base.friction = {0.3, 0.05};
  base.steady_launch = true;
  const Solution found = solve(base, Parameter::slope, {Of::survival, 0.9, 1000}, {.from = 7, .to = 10, .points = 4},
                               {.method = Method::integrated});
  ASSERT_EQ(found.found.size(), 1U);
  EXPECT_NEAR(found.found[0].at.value, 8.214, 0.005);
  EXPECT_LT(found.found[0].at.lower, found.found[0].at.value);
  EXPECT_LT(found.found[0].at.upper - found.found[0].at.lower, 0.03);
  EXPECT_TRUE(found.found[0].rising);
  ASSERT_EQ(found.studies.size(), 1U);
  EXPECT_TRUE(found.studies[0].setting->steady_speed);
}

// No wheel rolls on at the gentle end of the slopes: it takes one step, and that is below any target.
TEST(Solve, TakesAWheelThatRestsAtOnceForOneStep) {
  Setting base = paper_setting(7.02, true);
  base.steady_launch = true;
  const Solution found = solve(base, Parameter::slope, {Of::steps, 3, 0}, {.from = 1, .to = 9, .points = 5},
                               {.method = Method::integrated});
  ASSERT_EQ(found.found.size(), 1U);
  EXPECT_NEAR(found.scanned.front().answer.quantity.value, 1, 1e-4);
  EXPECT_GT(found.found[0].at.value, 5);
}

TEST(Solve, RefusesWhatHasNoMeaning) {
  const auto expect_message = [](const std::string& part, const std::function<void()>& work) {
    EXPECT_NE(message_of(work).find(part), std::string::npos);
  };
  const Setting base = paper_setting(7.02, true);
  const auto solved = [&](Parameter parameter, Target target, SolveOptions options) {
    return [=] { solve(base, parameter, target, options, {}); };
  };
  const Target hundred{Of::steps, 100, 0};
  expect_message("tip-radius has no meaning", solved(Parameter::tip_radius, hundred, {}));
  expect_message("steps: 1 is outside (1, inf)", solved(Parameter::slope, {Of::steps, 1, 0}, {}));
  expect_message("survive: probability 1 is outside (0, 1)", solved(Parameter::slope, {Of::survival, 1, 10}, {}));
  expect_message("reach: probability 0 is outside", solved(Parameter::slope, {Of::ramp_end, 0, 0}, {}));
  expect_message("--to: slope: 30 deg is outside", solved(Parameter::slope, hundred, {.from = 5, .to = 30}));
  expect_message("from: 9 is not below to: 5", solved(Parameter::friction_mean, hundred, {.from = 9, .to = 5}));
  expect_message("points: 2 is outside 3..1000", solved(Parameter::slope, hundred, {.points = 2}));
}

}  // namespace
}  // namespace metastable::analysis
