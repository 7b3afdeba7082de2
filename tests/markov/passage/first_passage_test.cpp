#include "markov/passage/first_passage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

Chain one_state(double kill) { return Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{kill}); }

/// Holds everything that is asked of one chain and one launch.
struct Problem {
  explicit Problem(const Chain& chain, Launch from)
      : solver(chain), quasi(quasi_stationary(solver)), launch(std::move(from)) {}
  Moments steps() const {
    const std::vector<double> mean = mean_first_passage(solver);
    return steps_from_launch(launch, mean, second_moment(solver, mean));
  }
  Survival survival() const { return Survival(solver, quasi, launch); }
  std::vector<double> quantiles(const std::vector<double>& reward, const std::vector<double>& p) const {
    return reward_quantiles(solver, quasi, launch, reward, p);
  }

  ChainSolver solver;
  QuasiStationary quasi;
  Launch launch;
};

Launch even_launch(std::size_t n, double rest) {
  return {std::vector<double>(n, (1 - rest) / static_cast<double>(n)), rest};
}

TEST(FirstPassage, GeometricLawInClosedForm) {
  for (const double kill : {1.0, 0.25, 1e-3, 1e-14}) {
    const Problem problem(one_state(kill), {{0.75}, 0.25});
    // Here T = 1 with probability 1/4, otherwise 1 + Geometric(kill).
    const double second = (2 - kill) / (kill * kill);
    EXPECT_NEAR(problem.steps().mean / (1 + 0.75 / kill), 1, 1e-14);
    EXPECT_NEAR(problem.steps().sd / std::sqrt(0.75 * second - std::pow(0.75 / kill, 2)), 1, 1e-12);
  }
}

TEST(FirstPassage, LaunchThatAlwaysRestsTakesOneStep) {
  const Problem problem(one_state(0.1), {{0.0}, 1.0});
  EXPECT_EQ(problem.steps().mean, 1);
  EXPECT_EQ(problem.steps().sd, 0);
  EXPECT_EQ(problem.survival().at(1), 0);
  EXPECT_EQ(problem.survival().at(1e9), 0);
  EXPECT_EQ(problem.survival().quantile(0.5), 1);
  EXPECT_EQ(problem.quantiles({2.0}, {0.1, 0.9}), (std::vector<double>{0, 0}));
}

TEST(FirstPassage, MomentsOfRandomChainsToRationalAnswers) {
  using reference::Rational;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const std::size_t n = 2 + seed % 5;
    const Chain chain = reference::random_chain(n, seed, std::pow(10.0, -static_cast<double>(seed)));
    const auto matrix = reference::generator<Rational>(chain);
    const auto mean = reference::gauss(matrix, std::vector<Rational>(n, 1));
    const auto second = reference::gauss(matrix, mean);
    const ChainSolver solver(chain);
    const std::vector<double> computed = mean_first_passage(solver);
    const std::vector<double> computed_second = second_moment(solver, computed);
    for (std::size_t i = 0; i < n; ++i) {
      EXPECT_NEAR(computed[i] / mean[i].convert_to<double>(), 1, 1e-14);
      EXPECT_NEAR(computed_second[i] / second[i].convert_to<double>(), 1, 1e-14);
    }
  }
}

TEST(RewardFromLaunch, UnitRewardCountsTheStepsAfterTheLaunch) {
  for (const auto& chain : {reference::random_chain(7, 1, 0.2), reference::cyclic_chain(3, 4, 2, 1e-4)}) {
    const Problem problem(chain, even_launch(chain.size(), 0.125));
    const Moments reward = reward_from_launch(problem.solver, problem.launch, std::vector<double>(chain.size(), 1.0));
    // There is one reward for every step but the last.
    EXPECT_NEAR(reward.mean / (problem.steps().mean - 1), 1, 1e-12);
    EXPECT_NEAR(reward.sd / problem.steps().sd, 1, 1e-11);
  }
}

// State 0 pays 2 and is left for 1 (pays 5) with probability 1/2, otherwise it rests; 1 always rests.
TEST(RewardFromLaunch, PaysOnEntering) {
  const Problem problem(Chain({0, 1, 1}, {1}, {0.5}, {0.5, 1}), {{1.0, 0.0}, 0.0});
  const Moments reward = reward_from_launch(problem.solver, problem.launch, std::vector<double>{2, 5});
  EXPECT_NEAR(reward.mean, 4.5, 1e-15);
  EXPECT_NEAR(reward.sd, 2.5, 1e-14);
}

TEST(Survival, MatchesTheChainStepByStep) {
  for (const auto& chain : {reference::random_chain(6, 4, 0.3), reference::cyclic_chain(8, 3, 6, 0.2)}) {
    const Problem problem(chain, even_launch(chain.size(), 0.1));
    const Survival survival = problem.survival();
    EXPECT_EQ(survival.at(0), 1);
    std::vector<double> alive = problem.launch.after;
    for (int n = 1; n < 300; ++n) {
      const double exact = std::accumulate(alive.begin(), alive.end(), 0.0);
      EXPECT_NEAR(survival.at(n) / exact, 1, 1e-10) << n;
      EXPECT_EQ(survival.at(n + 0.5), survival.at(n));
      alive = apply_left(chain, alive);
    }
  }
}

TEST(Survival, StartedInOneClassItFollowsTheCycle) {
  const Chain chain = reference::cyclic_chain(8, 3, 6, 0.2);
  Launch launch{std::vector<double>(chain.size(), 0.0), 0.0};
  launch.after[2] = 1;
  const Survival survival(ChainSolver(chain), quasi_stationary(ChainSolver(chain)), launch);
  std::vector<double> alive = launch.after;
  for (int n = 1; n < 300; ++n) {
    EXPECT_NEAR(survival.at(n) / std::accumulate(alive.begin(), alive.end(), 0.0), 1, 1e-10) << n;
    alive = apply_left(chain, alive);
  }
}

TEST(Survival, RareRestKeepsItsTail) {
  const Problem problem(one_state(1e-20), {{1.0}, 0.0});
  const Survival survival = problem.survival();
  EXPECT_NEAR(survival.at(1e20), std::exp(-1.0), 1e-12);
  EXPECT_NEAR(survival.quantile(0.5) / (1e20 * std::log(2.0)), 1, 1e-12);
}

// Nine in ten launches rest at once; the hazard of the others, 1e-12, must not be judged by differences of logarithms.
TEST(Survival, RareRestAfterAPoorLaunch) {
  const Problem problem(one_state(1e-12), {{0.1}, 0.9});
  EXPECT_NEAR(problem.survival().at(1e12), 0.1 * std::exp(-1.0), 1e-12);
  EXPECT_EQ(problem.survival().quantile(0.9 - 1e-12), 1);
  EXPECT_NEAR(problem.survival().quantile(0.95) / (1e12 * std::log(2.0)), 1, 1e-9);
}

TEST(Survival, QuantilesAreTheSmallestSuchStep) {
  for (const auto& chain :
       {reference::random_chain(6, 4, 0.3), reference::cyclic_chain(8, 3, 6, 0.05), one_state(0.01)}) {
    const Problem problem(chain, even_launch(chain.size(), 0.05));
    const Survival survival = problem.survival();
    for (const double p : {0.01, 0.05, 0.3, 0.5, 0.9, 0.999, 1 - 1e-9}) {
      const double n = survival.quantile(p);
      EXPECT_EQ(n, std::floor(n));
      EXPECT_LE(survival.at(n), (1 - p) * (1 + 1e-9)) << p;
      EXPECT_GT(survival.at(n - 1), (1 - p) * (1 - 1e-9)) << p;
    }
  }
}

TEST(Survival, ChainThatNeverReturns) {
  const Problem problem(Chain({0, 1, 1}, {1}, {0.5}, {0.5, 1}), {{1.0, 0.0}, 0.0});
  const Survival survival = problem.survival();
  EXPECT_EQ(survival.at(1), 1);
  EXPECT_NEAR(survival.at(2), 0.5, 1e-15);
  EXPECT_EQ(survival.at(3), 0);
  EXPECT_EQ(survival.at(1e6), 0);
  EXPECT_EQ(survival.quantile(0.75), 3);
  EXPECT_NEAR(problem.quantiles({2, 5}, {0.25})[0], 2, 1e-9);
  EXPECT_NEAR(problem.quantiles({2, 5}, {0.75})[0], 7, 1e-9);
}

TEST(Survival, LaunchThatSettlesElsewhereIsAnError) {
  // State 0 survives longer than state 1, and is not reached from there.
  const Chain chain({0, 1, 1}, {1}, {0.001}, {0, 0.5});
  const Problem problem(chain, {{0.0, 1.0}, 0.0});
  EXPECT_EQ(
      message_of<ConvergenceError>([&] { Survival(problem.solver, problem.quasi, problem.launch, 50); }).substr(0, 56),
      "survival iteration did not converge: residual 691.801: a");
}

// With reward 1 on every step the total is the number of steps less one.
TEST(RewardQuantiles, UnitRewardFollowsTheSteps) {
  for (const auto& chain :
       {reference::random_chain(6, 4, 0.3), reference::cyclic_chain(4, 3, 6, 0.05), one_state(1e-3)}) {
    const Problem problem(chain, even_launch(chain.size(), 0.05));
    const std::vector<double> p{0.03, 0.1, 0.5, 0.9, 0.99};
    const std::vector<double> total = problem.quantiles(std::vector<double>(chain.size(), 1.0), p);
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double steps = problem.survival().quantile(p[i]) - 1;
      EXPECT_NEAR(total[i], steps, 0.002 * steps + 1e-9) << p[i];
    }
  }
}

// With rare rest the total is exponential with the exact mean.
TEST(RewardQuantiles, ExponentialWhenRestIsRare) {
  for (const auto& chain : {reference::random_chain(20, 8, 1e-12), reference::cyclic_chain(8, 5, 8, 1e-12)}) {
    const Problem problem(chain, even_launch(chain.size(), 0.0));
    std::vector<double> seconds(chain.size());
    for (std::size_t i = 0; i < seconds.size(); ++i) seconds[i] = 0.3 + 0.01 * static_cast<double>(i);
    const double mean = reward_from_launch(problem.solver, problem.launch, seconds).mean;
    const std::vector<double> p{0.05, 0.5, 0.95};
    const std::vector<double> total = problem.quantiles(seconds, p);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(total[i] / (-std::log1p(-p[i]) * mean), 1, 2e-6);
  }
}

// The launch is ten steps away from any rest: steps without rest must not pass for a settled law.
TEST(RewardQuantiles, CorridorBeforeTheHazard) {
  constexpr std::size_t n = 11;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.0);
  for (std::size_t i = 0; i + 1 < n; ++i) matrix[i * n + i + 1] = 1;
  kill[n - 1] = 0.01;
  Launch launch{std::vector<double>(n, 0.0), 0.0};
  launch.after[0] = 1;
  const Problem problem(Chain::from_dense(n, matrix, kill), launch);
  // There are 11 rewards for certain, and then one for every step survived.
  const std::vector<double> total = problem.quantiles(std::vector<double>(n, 2.0), {0.005, 0.5});
  EXPECT_NEAR(total[0], 22, 1e-9);
  EXPECT_NEAR(total[1], 22 + 2 * (std::ceil(std::log(0.5) / std::log(0.99)) - 1), 1e-9);
}

/// Returns the sorted totals of trials that rest at the launch with probability 0.1 and else start in any state.
std::vector<double> totals_of_trials(const Chain& chain, const std::vector<double>& seconds, int trials) {
  std::mt19937_64 engine(2024);
  std::uniform_real_distribution<double> uniform;
  std::vector<double> totals;
  for (int trial = 0; trial < trials; ++trial) {
    double total = 0;
    if (uniform(engine) >= 0.1) {
      auto state = static_cast<std::size_t>(uniform(engine) * static_cast<double>(chain.size()));
      for (bool walking = true; walking;) {
        total += seconds[state];
        double draw = uniform(engine) - chain.kill(state);
        walking = draw >= 0;
        std::size_t next = state;
        for (std::size_t e = 0; walking && e < chain.columns(state).size(); ++e) {
          if (draw < chain.values(state)[e]) {
            next = chain.columns(state)[e];
            break;
          }
          draw -= chain.values(state)[e];
        }
        state = next;
      }
    }
    totals.push_back(total);
  }
  std::sort(totals.begin(), totals.end());
  return totals;
}

TEST(RewardQuantiles, AgreeWithTrials) {
  const std::size_t n = 5;
  const Chain chain = reference::random_chain(n, 12, 0.1);
  const Problem problem(chain, even_launch(n, 0.1));
  const std::vector<double> seconds{0.30, 0.35, 0.42, 0.50, 0.61};
  constexpr int trial_count = 200000;
  const std::vector<double> totals = totals_of_trials(chain, seconds, trial_count);
  const Moments exact = reward_from_launch(problem.solver, problem.launch, seconds);
  const double mean = std::accumulate(totals.begin(), totals.end(), 0.0) / trial_count;
  EXPECT_NEAR(mean, exact.mean, 4 * exact.sd / std::sqrt(trial_count));
  const std::vector<double> p{0.05, 0.25, 0.5, 0.75, 0.95, 0.99};
  const std::vector<double> computed = problem.quantiles(seconds, p);
  EXPECT_EQ(computed[0], 0);
  for (std::size_t i = 1; i < p.size(); ++i) {
    // It lies within sampling error of the probability, and the shape of one step's law (0.02 s here).
    const auto at = [&](double q) { return totals[static_cast<std::size_t>(q * trial_count)]; };
    const double se = std::sqrt(p[i] * (1 - p[i]) / trial_count);
    EXPECT_GE(computed[i], at(p[i] - 4 * se) - 0.02) << p[i];
    EXPECT_LE(computed[i], at(std::min(p[i] + 4 * se, 1 - 1e-5)) + 0.02) << p[i];
  }
}

// Walkers that soon fall: the slower the step the longer it takes and the likelier it is the last, so that the time of
// few steps is far from normal (where a normal stood, probabilities were off by 0.03).
TEST(RewardQuantiles, OfFewSkewedStepsAgreeWithTrials) {
  constexpr std::size_t n = 60;
  std::vector<double> matrix(n * n), kill(n), seconds(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double slow = static_cast<double>(i) / (n - 1);
    seconds[i] = 0.15 + 0.5 * slow * slow * slow * slow;
    kill[i] = 0.15 + 0.6 * slow * slow;
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] = (1 - kill[i]) / n;
  }
  const Chain chain = Chain::from_dense(n, matrix, kill);
  const Problem problem(chain, even_launch(n, 0.1));
  constexpr int trial_count = 200000;
  const std::vector<double> totals = totals_of_trials(chain, seconds, trial_count);
  const std::vector<double> p{0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9, 0.99};
  const std::vector<double> computed = problem.quantiles(seconds, p);
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto below = std::upper_bound(totals.begin(), totals.end(), computed[i]) - totals.begin();
    const double spacing = 1.0 / n;  // of the atoms after one step
    EXPECT_NEAR(static_cast<double>(below) / trial_count, p[i],
                4 * std::sqrt(p[i] * (1 - p[i]) / trial_count) + 0.004 + (p[i] < 0.5 ? 0.4 * spacing : 0))
        << p[i];
  }
}

TEST(FirstPassage, IllegalInputs) {
  const Problem problem(one_state(0.5), {{1.0}, 0.0});
  const std::vector<double> one{1};
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              steps_from_launch({{0.5}, 0.25}, one, one);
            }),
            "launch: probabilities must be >= 0 and sum to 1, got 0.750000");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              steps_from_launch({{-0.5}, 1.5}, one, one);
            }),
            "launch: probabilities must be >= 0 and sum to 1, got 1.000000");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              steps_from_launch({{0.5, 0.5}, 0}, one, one);
            }),
            "launch: 2 entries for 1 states");
  EXPECT_EQ(message_of<std::invalid_argument>([&] { second_moment(problem.solver, std::vector<double>(2)); }),
            "mean first passage: 2 entries for 1 states");
  EXPECT_EQ(message_of<std::invalid_argument>(
                [&] { reward_from_launch(problem.solver, problem.launch, std::vector<double>{-1}); }),
            "reward: entry 0 is -1.000000, not a finite number >= 0");
  EXPECT_EQ(message_of<std::invalid_argument>([&] { problem.quantiles({1}, {1.0}); }),
            "reward quantile: a probability between 0 and 1 is needed");
  EXPECT_EQ(message_of<std::invalid_argument>([&] { problem.survival().at(-1); }),
            "survival: the number of steps must be >= 0");
  EXPECT_EQ(message_of<std::invalid_argument>([&] { problem.survival().quantile(0); }),
            "quantile: a probability between 0 and 1 is needed");
}

// A certain number of steps scatters by nothing, a geometric one by sqrt(1 - p) / p.
TEST(FirstPassageSd, IsNoDifferenceOfSquares) {
  constexpr std::size_t n = 2000;
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  for (std::size_t i = 0; i + 1 < n; ++i) {
    column.push_back(static_cast<std::uint32_t>(i + 1));
    start.push_back(column.size());
  }
  start.push_back(column.size());
  std::vector<double> kill(n, 0.0);
  kill.back() = 1;
  const ChainSolver line(Chain(start, column, std::vector<double>(n - 1, 1.0), kill));
  for (const double sd : first_passage_sd(line, mean_first_passage(line))) EXPECT_LT(sd, 1e-9);
  for (const double p : {0.5, 1e-8, 1e-200, 1e-300}) {
    const ChainSolver one(Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{p}));
    EXPECT_NEAR(first_passage_sd(one, mean_first_passage(one))[0] / (std::sqrt(1 - p) / p), 1, 1e-14) << p;
  }
}

}  // namespace
}  // namespace metastable::markov
