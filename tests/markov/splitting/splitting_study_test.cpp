// Tests splitting against exact chains and quadrature, and what it refuses.

#include "markov/splitting/splitting_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "markov/mesh/batch_simulation.h"
#include "tests/markov/mesh/maps.h"
#include "tests/markov/splitting/ladder.h"

namespace metastable::markov::testing {
namespace {

const SplittingOptions quick{.replicas = 200, .rounds = 8, .pilots = 2, .tolerance = 0.3, .seed = 3, .threads = 1};

/// The answer agrees with what is known: it lies within twice the interval, on a logarithmic scale.
void expect_near(const SplittingStudy& study, double steps) {
  EXPECT_EQ(study.disagreement, "");
  const double half = 0.5 * std::log(study.steps.upper / study.steps.lower);
  EXPECT_LT(half, 0.6);
  EXPECT_LT(std::abs(std::log(study.steps.value / steps)), 2 * half) << study.steps.value << " for " << steps;
  EXPECT_NEAR(steps_from_quasi_stationary(study).value * study.failure_rate.value, 1, 1e-12);
}

TEST(SplittingStudy, FindsTheStepsOfALineByQuadrature) {
  expect_near(splitting_study(linear_batch(1.5), std::vector{2.0}, quick), linear_steps(1.5, 2));  // 11.6
  expect_near(splitting_study(linear_batch(0.4), std::vector{2.0}, quick), linear_steps(0.4, 2));  // 1.4e5
}

TEST(SplittingStudy, FindsTheStepsOfAFiniteChain) {
  const Ladder ladder{.top = 9, .up = 0.15};
  expect_near(splitting_study(ladder.batch(), std::vector{0.0}, quick), ladder.steps());
  expect_near(splitting_study(ladder.drawing(), std::vector{0.0}, quick), ladder.steps());
}

TEST(SplittingStudy, TakesMapsOfSeveralPhases) {
  const SplittingStudy study = splitting_study(two_phase_batch(0.6), std::vector{2.0}, quick);
  const auto walked = mesh_study(two_phase_batch(0.6), std::vector{2.0},
                                 {.spacing = 0.6, .threads = 1, .guided_samples = 0, .simulated_steps = 0});
  expect_near(study, walked.steps.value);
  EXPECT_NO_THROW(require_agreement(walked, study, "two phases"));
}

/// The state has eight numbers: the line of linear_batch(), and seven that fade, mixed by a reflection.
BatchMap eight_batch(double sd) {
  BatchMap map;
  map.dimension = map.scores = 8;
  map.step = [sd](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const auto reflect = [](const double* from, double* to) {
        double mean = 0;
        for (int k = 0; k < 8; ++k) mean += from[k] / 8;
        for (int k = 0; k < 8; ++k) to[k] = from[k] - 2 * mean;
      };
      double x[8];
      reflect(&states[8 * i], x);
      for (int k = 0; k < 8; ++k) x[k] = (k == 0 ? 0.5 : 0.1 * k) * x[k] + (k == 0 ? sd : 1) * scores[8 * i + k];
      x[0] += 1;
      failed[i] = x[0] <= 0;
      reflect(x, &next[8 * i]);
    }
  };
  return map;
}

TEST(SplittingStudy, TakesEightDimensions) {
  std::vector<double> start(8, -0.5);
  start[0] = 1.5;
  expect_near(splitting_study(eight_batch(0.6), start, quick), linear_steps(0.6, 2));
  EXPECT_THROW(mesh_study(eight_batch(0.6), start), TooManyDimensions);
}

/// Two numbers shrink by 0.3; beyond 3 they grow threefold, with no way back, until one is beyond 100.
BatchMap running_away() {
  BatchMap map;
  map.dimension = map.scores = 2;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      for (std::size_t k = 2 * i; k < 2 * i + 2; ++k) {
        next[k] = std::abs(states[k]) > 3 ? 3 * states[k] : 0.3 * states[k] + scores[k];
        if (std::abs(next[k]) > 100) failed[i] = 1;
      }
    }
  };
  return map;
}

TEST(SplittingStudy, FallingWalksDoNotPassForMemory) {
  const std::vector<double> start{0, 0};
  const SplittingStudy study = splitting_study(running_away(), start, quick);
  EXPECT_LT(study.mixing_steps, 3);  // 0.8, were there no failures
  expect_near(study, simulate_steps(running_away(), start, {.trials = 4000, .threads = 1})->mean);
}

/// Beyond 2.5 the first number is lost, and a second one counts six steps to failure.
BatchMap lost_for_six_steps() {
  BatchMap map;
  map.dimension = 2;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const bool lost = states[2 * i + 1] > 0;
      next[2 * i] = lost ? 0 : 0.5 * states[2 * i] + 0.8 * scores[i];
      next[2 * i + 1] = lost ? states[2 * i + 1] + 1 : std::abs(next[2 * i]) > 2.5;
      failed[i] = next[2 * i + 1] > 6;
    }
  };
  return map;
}

TEST(SplittingStudy, AWalkThatIsBoundToFailDoesNotPassForMemory) {
  const std::vector<double> start{0, 0};
  const SplittingStudy study = splitting_study(lost_for_six_steps(), start, quick);
  EXPECT_LT(study.mixing_steps, 12);
  expect_near(study, simulate_steps(lost_for_six_steps(), start, {.trials = 4000, .threads = 1})->mean);
}

TEST(SplittingStudy, CountsStepsWhereWalksFailBeforeTheStartIsForgotten) {
  BatchMap map;
  map.dimension = map.scores = 1;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) next[i] = states[i] - 1 + 0.5 * scores[i], failed[i] = next[i] < 0;
  };
  const std::vector<double> start{3};
  const SplittingStudy study = splitting_study(map, start, quick);
  EXPECT_TRUE(study.all_failed);
  EXPECT_EQ(study.disagreement, "");
  EXPECT_TRUE(std::isnan(study.failure_rate.value) && study.rates.empty());
  EXPECT_LT(study.survival.back().value, 1e-6);
  const SimulatedSteps simulated = *simulate_steps(map, start, {.trials = 100000, .threads = 1});
  EXPECT_NEAR(study.steps.value, simulated.mean, 4 * simulated.standard_error + study.steps.upper - study.steps.lower);
}

TEST(SplittingStudy, IsTheSameOnAnyNumberOfThreads) {
  SplittingOptions two = quick;
  two.threads = 3;
  const SplittingStudy a = splitting_study(linear_batch(0.8), std::vector{2.0}, quick);
  const SplittingStudy b = splitting_study(linear_batch(0.8), std::vector{2.0}, two);
  EXPECT_EQ(a.steps.value, b.steps.value);
  EXPECT_EQ(a.steps.upper, b.steps.upper);
  EXPECT_EQ(a.rates, b.rates);
}

TEST(SplittingStudy, TakesALevelOfTheUsers) {
  SplittingOptions options = quick;
  options.level = [](int, auto states, auto levels) {
    for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = -states[i];
  };
  expect_near(splitting_study(linear_batch(0.4), std::vector{2.0}, options), linear_steps(0.4, 2));
  options.level = [](int, auto states, auto levels) {
    for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = states[i] < 1 ? NAN : -states[i];
  };
  EXPECT_THROW(splitting_study(linear_batch(0.4), std::vector{2.0}, options), MapError);
}

TEST(SplittingStudy, SaysAfterHowManyStepsNothingFailed) {
  BatchMap map = linear_batch(0.4);
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) next[i] = states[i] / 2 + std::tanh(scores[i]), failed[i] = 0;
  };
  SplittingOptions options = quick;
  options.most_calls = 400000;
  try {
    splitting_study(map, std::vector{0.0}, options);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("splitting: nothing fails in 5"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("steps of the map"), std::string::npos) << error.what();
  }
}

TEST(SplittingStudy, GivesNoNumberWhereWalksSlipIntoAnotherGaitTooSeldomToSettle) {
  const TwoGaits two{.sd = 0.3, .far = 0.9};  // slips come every 793 steps
  for (const std::uint64_t seed : {1U, 2U}) {
    SplittingOptions options = quick;
    options.seed = seed;
    const SplittingStudy study = splitting_study(two.batch(), std::vector{-1.0}, options);
    EXPECT_NE(study.disagreement.find("are in another gait, at x1 = 0.99"), std::string::npos) << study.disagreement;
    EXPECT_THROW(require_agreement(study, "two gaits"), Disagreement);
  }
}

TEST(SplittingStudy, CountsGaitsBetweenWhichWalksSlipOften) {
  const TwoGaits two{.sd = 0.7, .far = 2.6};
  const SplittingOptions whole{.replicas = 1000, .rounds = 16, .pilots = 4, .tolerance = 0.3, .seed = 3, .threads = 1};
  expect_near(splitting_study(two.batch(), std::vector{-1.0}, whole), two.steps());
}

TEST(SplittingStudy, NamesOptionsOutOfRange) {
  const auto refusal = [](SplittingOptions options) {
    try {
      splitting_study(linear_batch(1), std::vector{2.0}, options);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal({.replicas = 99}), "splitting: 99 replicas, 100 or more expected");
  EXPECT_EQ(refusal({.rounds = 9, .pilots = 2}),
            "splitting: 9 rounds, 8 or more and a multiple of the 2 pilots expected");
  EXPECT_EQ(refusal({.tolerance = 0}), "splitting: a tolerance of 0, above 0 expected");
}

TEST(SplittingStudy, HearsItsListenerAndStopsWhenThatThrows) {
  SplittingOptions options = quick;
  int heard = 0;
  options.progress = [&](double share) {
    EXPECT_GE(share, 0);
    EXPECT_LE(share, 1);
    if (++heard == 20) throw std::domain_error("enough");
  };
  EXPECT_THROW(splitting_study(linear_batch(0.8), std::vector{2.0}, options), std::domain_error);
}

}  // namespace
}  // namespace metastable::markov::testing
