#include "analysis/diagnosis/machine_steps.h"

#include <gtest/gtest.h>

#include <boost/math/distributions/gamma.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Draws at the middle of equally likely parts of a lognormal distribution.
std::vector<double> lognormal(double median, double sd) {
  std::vector<double> draws;
  for (const double z : {-1.645, -1.036, -0.674, -0.385, -0.126, 0.126, 0.385, 0.674, 1.036, 1.645})
    draws.push_back(median * std::exp(sd * z));
  return draws;
}

// The data tell the sum of two parameters and hardly the first, which errors of form move.
class Ridge : public test::Line {
 public:
  explicit Ridge(std::function<double(double, double)> log_steps)
      : Line(test::line(0, 1, 8)), log_steps_(std::move(log_steps)) {
    nuisances_ = {{"first", 0, 1e3, 1e-4, -1e3, 1e3}, {"second", 0, 1e3, 1e-4, -1e3, 1e3}};
    nuisances_[0].form_sd = 3;
  }
  double expected_steps(std::span<const double> n, std::span<const EffectTerm>, std::uint64_t) const override {
    return std::exp(log_steps_(n[0], n[1]));
  }

 private:
  std::function<double(double, double)> log_steps_;
};

// Returns the standard deviation of the logarithm of the steps that a fit to such data leaves open.
double drawn_sd(std::function<double(double, double)> log_steps) {
  const Ridge model(std::move(log_steps));
  Fit fit;
  fit.nuisance = {0, 0};
  fit.information = Eigen::Matrix2d{{1e4 + 1, 1e4}, {1e4, 1e4 + 1}};
  double sum = 0, squares = 0;
  constexpr int draws = 400;
  for (const double steps : drawn_steps(model, model, {{&fit, 1}}, draws, 1, 1, [] {})) {
    sum += std::log(steps);
    squares += std::log(steps) * std::log(steps);
  }
  return std::sqrt(squares / draws - sum * sum / draws / draws);
}

TEST(MachineSteps, ErrorsOfFormMoveWhatTheDataLeaveOpen) {
  EXPECT_LT(drawn_sd([](double first, double second) { return first + second; }), 0.02);  // 0.01 by the data
  EXPECT_NEAR(drawn_sd([](double first, double) { return first; }), std::sqrt(9.5), 0.5);
}

TEST(MachineSteps, ObservedLimitsAreThoseOfAPoissonMean) {
  StepsBeforeFailure steps;
  set_observed(steps, {1000, 0});
  EXPECT_EQ(steps.observed, infinity);
  EXPECT_NEAR(steps.observed_lower, 1000 / -std::log(0.05), 1e-9);  // no event has a mean below ln 20
  EXPECT_EQ(steps.observed_upper, infinity);
  set_observed(steps, {1000, 10});
  EXPECT_EQ(steps.observed, 100);
  EXPECT_NEAR(steps.observed_lower, 1000 / 16.962, 1e-2);  // tables of the Poisson distribution
  EXPECT_NEAR(steps.observed_upper, 1000 / 5.4254, 1e-2);
  StepsBeforeFailure unknown;
  set_observed(unknown, {0, 0});
  EXPECT_EQ(unknown.observed, 0);
}

TEST(MachineSteps, IntervalsOfDrawsFollowTheirLogarithms) {
  const Estimate e = interval_of_draws({50, 100, 200});
  EXPECT_NEAR(e.value, 100, 1e-9);
  EXPECT_NEAR(e.lower, 100 * std::exp(-1.6448536 * std::log(2.0)), 1e-6);
  EXPECT_NEAR(e.upper, 100 * std::exp(1.6448536 * std::log(2.0)), 1e-4);
  EXPECT_EQ(interval_of_draws({50, 100, 200, infinity}).upper, infinity);
  EXPECT_EQ(interval_of_draws({infinity, infinity}).lower, infinity);
  EXPECT_THROW(interval_of_draws({}), std::invalid_argument);
}

// A model that says nothing leaves the count: with a flat prior on the logarithm of the steps the rate has the gamma
// distribution of as many events.
TEST(MachineSteps, AModelThatLacksEverythingLeavesTheCountAlone) {
  const std::vector<double> draws(10, 100.0);
  const Estimate e = joined_steps(draws, draws, {8, 0}, 4000, 20);
  const boost::math::gamma_distribution rate(20.0, 1 / 4000.0);
  EXPECT_NEAR(e.value, 1 / quantile(rate, 0.5), 0.25 * e.value);  // the grid's nodes are so far apart
  EXPECT_GT(e.lower, 0.7 / quantile(rate, 0.95));
  EXPECT_LT(e.upper, 1.4 / quantile(rate, 0.05));
}

// The steps of a model that leaves something out are a multiple of the machine's: its prior says which where few
// failures were counted, else the count does.
TEST(MachineSteps, TheCostOfIgnoringIsWhatTheCountSaysOfTheModel) {
  const std::vector<double> draws(10, 300.0);
  const Estimate few = steps_of_model_by_machine(draws, {0.5, 0}, 0, 0);
  EXPECT_NEAR(few.value, 1, 0.03);
  EXPECT_NEAR(few.upper, std::exp(0.5 * 1.645), 0.05);
  const Estimate many = steps_of_model_by_machine(draws, {3, 0}, 40000, 400);  // a hundred steps
  EXPECT_NEAR(many.value, 3, 0.3);
  EXPECT_LT(many.upper, 3.6);
  EXPECT_GT(many.lower, 2.5);
  EXPECT_EQ(steps_of_model_by_machine({infinity}, {1, 0}, 100, 3).value, infinity);
}

// Where nothing was counted, or much less than the model knows, the model's own interval stands.
TEST(MachineSteps, ACountThatSaysLittleLeavesTheModel) {
  const std::vector<double> draws = lognormal(300, 0.1);
  const Estimate alone = joined_steps(draws, draws, {0.01, 0}, 0, 0),
                 with = joined_steps(draws, draws, {0.01, 0}, 600, 2);
  EXPECT_NEAR(alone.value, 300, 15);
  EXPECT_NEAR(with.value / alone.value, 1, 0.02);
  EXPECT_NEAR(with.lower / alone.lower, 1, 0.05);
}

// The kernels that stand for a few draws spread no further than these do.
TEST(MachineSteps, AFewDrawsAreNotSpreadFurther) {
  std::vector<double> draws;
  for (int i = 0; i < 16; ++i) draws.push_back(300 * std::exp(0.3 * dynamics::normal_quantile((i + 0.5) / 16)));
  const Estimate joined = joined_steps(draws, draws, {1e-6, 0}, 0, 0), moments = interval_of_draws(draws);
  const double ratio = std::log(joined.upper / joined.lower) / std::log(moments.upper / moments.lower);
  EXPECT_LT(ratio, 1.05);
  EXPECT_GT(ratio, 0.9);
}

// A count narrows what a model's error leaves open, and a model what a count does.
TEST(MachineSteps, AModelAndACountThatAgreeNarrowOneAnother) {
  const std::vector<double> draws(10, 200.0);
  const auto width = [](const Estimate& e) { return std::log(e.upper / e.lower); };
  const Estimate model = joined_steps(draws, draws, {0.4, 0}, 0, 0),
                 joined = joined_steps(draws, draws, {0.4, 0}, 4000, 20);
  StepsBeforeFailure counted;
  set_observed(counted, {4000, 20});
  EXPECT_LT(width(joined), width(model));
  EXPECT_LT(width(joined), std::log(counted.observed_upper / counted.observed_lower));
  EXPECT_NEAR(joined.value, 200, 20);
}

// The likelihood of the fits holds the rests already: parameters are not corrected by them once more.
TEST(MachineSteps, TheCountSaysNothingOfParametersThatTheFitsKnow) {
  const std::vector<double> draws = lognormal(200, 0.3);
  const Estimate alone = joined_steps(draws, draws, {1e-6, 0}, 0, 0),
                 with = joined_steps(draws, draws, {1e-6, 0}, 4000, 10);
  EXPECT_NEAR(std::log(with.value / alone.value), 0, 0.15);
  EXPECT_GT(std::log(with.upper / with.lower), 0.8 * std::log(alone.upper / alone.lower));
}

// An error that the count shows here multiplies what the model says there; how it differs there widens the interval.
TEST(MachineSteps, WhatTheCountShowsHereHoldsElsewhere) {
  const std::vector<double> here(10, 100.0), there(10, 1000.0);
  const Estimate known = joined_steps(here, there, {1, 0}, 20000, 100);  // 200 were counted where the model has 100
  EXPECT_NEAR(known.value, 2000, 200);
  const Estimate differs = joined_steps(here, there, {1, 0.5}, 20000, 100);
  EXPECT_LT(differs.lower, known.lower);
  EXPECT_GT(differs.upper, known.upper);
}

TEST(MachineSteps, WhatNeverRestsHasNoUpperEnd) {
  const std::vector<double> draws{infinity, infinity, 1e6};
  EXPECT_EQ(joined_steps(draws, draws, {0.1, 0}, 500, 0).upper, infinity);
  EXPECT_THROW(joined_steps(draws, {}, {0.1, 0}, 500, 0), std::invalid_argument);
}

// Rests refute a model that never fails: the count is left.
TEST(MachineSteps, RestsRefuteAModelThatNeverFails) {
  const std::vector<double> draws(5, infinity);
  const Estimate e = joined_steps(draws, draws, {0.1, 0}, 1000, 10);
  EXPECT_EQ(e.value, 100);
  EXPECT_NEAR(e.lower, 1000 / 16.962, 1e-2);
  EXPECT_NEAR(e.upper, 1000 / 5.4254, 1e-2);
}

// Trials that all survive bound the steps from below; a model that does not explain them says nothing more.
TEST(MachineSteps, SurvivorsLeaveABound) {
  StepsBeforeFailure counted;
  set_observed(counted, {300, 0});
  const MachineSteps by_count = survivors_steps("", 5000, counted, false);
  EXPECT_TRUE(by_count.at_least);
  EXPECT_NEAR(by_count.steps.lower, 300 / -std::log(0.05), 1e-9);
  EXPECT_EQ(by_count.steps.upper, infinity);
  EXPECT_EQ(survivors_steps("", 5000, counted, true).steps.lower, 5000);
  EXPECT_EQ(survivors_steps("", infinity, counted, true).steps.lower, by_count.steps.lower);
  EXPECT_EQ(survivors_steps("on a slope of 8 deg", 7e-22, counted, true).steps.lower, 1);
}

// 25 rests in 850 collisions; a model whose draws reach from 0.7 to 142 steps says less than they do.
TEST(MachineSteps, AreNoWiderThanTheCount) {
  StepsBeforeFailure counted;
  set_observed(counted, {850, 25});
  EXPECT_EQ(bounded_by_count({6.3, 0.7, 142}, counted).value, 34);
  EXPECT_EQ(bounded_by_count({6.3, 0.7, 142}, counted).upper, counted.observed_upper);
  EXPECT_EQ(bounded_by_count({36, 30, 44}, counted).value, 36);
  StepsBeforeFailure nothing;
  set_observed(nothing, {850, 0});
  EXPECT_EQ(bounded_by_count({6.3, 0.7, 142}, nothing).value, 6.3);
}

}  // namespace
}  // namespace metastable::analysis
