#include "markov/chain/solver.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numeric>

#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

TEST(ChainSolver, CyclicChainsSolveAsTheWholeChainDoes) {
  for (const std::size_t period : {2, 3, 8}) {
    const Chain chain = reference::cyclic_chain(period, 4, 7, 1e-6);
    const ChainSolver solver(chain);
    EXPECT_EQ(solver.period().period, static_cast<int>(period));
    EXPECT_EQ(solver.revolution().size(), 4u);
    const Elimination whole(chain);
    std::vector<double> rhs(chain.size());
    for (std::size_t i = 0; i < rhs.size(); ++i) rhs[i] = static_cast<double>(i % 3);
    const auto right = solver.solve(rhs), right_whole = whole.solve(rhs);
    const auto left = solver.solve_left(rhs), left_whole = whole.solve_left(rhs);
    for (std::size_t i = 0; i < rhs.size(); ++i) {
      EXPECT_NEAR(right[i] / right_whole[i], 1, 1e-13);
      EXPECT_NEAR(left[i] / left_whole[i], 1, 1e-13);
    }
  }
}

// Blocks are sparse: a walk without staying has period 2; the product of its halves has bandwidth 1.
TEST(ChainSolver, LongWalkOfPeriodTwo) {
  constexpr std::size_t n = 20000;
  const ChainSolver solver(reference::birth_death(n, 0.5, 0.5, true));
  EXPECT_EQ(solver.period().period, 2);
  EXPECT_LE(solver.revolution().entries(), n);
  const std::vector<double> mean = mean_first_passage(solver);
  for (std::size_t i = 0; i < n; i += 997) {
    EXPECT_NEAR(mean[i] / static_cast<double>((i + 1) * (n - i)), 1, 1e-10);
  }
}

TEST(ChainSolver, RevolutionConservesProbability) {
  const ChainSolver solver(reference::cyclic_chain(5, 6, 3, 0.2));
  const Chain& revolution = solver.revolution();
  EXPECT_EQ(find_period(revolution).period, 1);
  // This is rest within one revolution, from the chain itself.
  std::vector<double> alive(solver.chain().size(), 1.0);
  for (int step = 0; step < 5; ++step) alive = markov::apply(solver.chain(), alive);
  for (std::size_t i = 0; i < revolution.size(); ++i) {
    EXPECT_NEAR(revolution.kill(i), 1 - alive[solver.period().classes[0][i]], 1e-14);
  }
}

TEST(ChainSolver, ARingWithOneExit) {
  // Every revolution ends at rest with probability 1e-18: m = 8 / 1e-18 (less the part of the first one).
  std::vector<double> matrix(64, 0.0), kill(8, 0.0);
  for (std::size_t i = 0; i < 8; ++i) matrix[i * 8 + (i + 1) % 8] = 1;
  kill[5] = 1e-18;
  const ChainSolver solver(Chain::from_dense(8, matrix, kill));
  EXPECT_EQ(solver.revolution().kill(0), 1e-18);
  for (const double mean : mean_first_passage(solver)) EXPECT_NEAR(mean * 1e-18 / 8, 1, 1e-14);
}

TEST(ChainSolver, IllegalInputs) {
  const Chain stuck({0, 1, 2, 2}, {1, 0}, {1, 1}, {0, 0, 1});
  EXPECT_EQ(message_of<std::domain_error>([&] { ChainSolver{stuck}; }),
            "chain solver: rest cannot be reached from state 0");
  const ChainSolver solver(reference::birth_death(4, 0.5, 0.5, true));
  EXPECT_EQ(message_of<std::invalid_argument>([&] { solver.solve(std::vector<double>(3)); }),
            "vector of size 3 for a chain of 4 states");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              solver.solve_left(std::vector<double>{0, 0, -1, 0});
            }),
            "right side: entry 2 is -1.000000, not a finite number >= 0");
  EXPECT_EQ(message_of<std::invalid_argument>([&] { markov::apply(solver.chain(), std::vector<double>(1)); }),
            "vector of size 1 for a chain of 4 states");
}

TEST(Apply, IncludesStaying) {
  const Chain chain = reference::birth_death(3, 0.25, 0.5, false);
  EXPECT_EQ(markov::apply(chain, std::vector<double>{1, 2, 4}), (std::vector<double>{0.75, 2.0, 3.0}));
  EXPECT_EQ(apply_left(chain, std::vector<double>{1, 2, 4}), (std::vector<double>{1.25, 2.75, 2.5}));
}

/// Makes a random sparse chain with a ring through all its states (so irreducible), aperiodic or not, and kill rates
/// over many orders of magnitude.
Chain arbitrary_chain(int size, unsigned seed, double rarest) {
  const auto n = static_cast<std::size_t>(size);
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      if (uniform(engine) < 0.2) matrix[i * n + j] = std::pow(10, -8 * uniform(engine));
    }
    if (n > 1) matrix[i * n + (i + 1) % n] = 1;
    if (i == 0 || uniform(engine) < 0.3) kill[i] = std::pow(rarest, uniform(engine));
    double sum = kill[i];
    for (std::size_t j = 0; j < n; ++j) sum += matrix[i * n + j];
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] /= sum;
    kill[i] /= sum;
  }
  return Chain::from_dense(n, matrix, kill);
}

RC_GTEST_PROP(ChainSolverProperty, NeverANegativeTimeNeverNaN, ()) {
  const int size = *rc::gen::inRange(1, 25);
  const auto seed = *rc::gen::arbitrary<unsigned>();
  const double rarest = std::pow(10.0, -*rc::gen::inRange(0, 40));
  const ChainSolver solver(arbitrary_chain(size, seed, rarest));
  const std::vector<double> mean = mean_first_passage(solver);
  const std::vector<double> second = second_moment(solver, mean);
  for (std::size_t i = 0; i < mean.size(); ++i) {
    RC_ASSERT(std::isfinite(mean[i]));
    RC_ASSERT(mean[i] >= 1);
    RC_ASSERT(second[i] >= mean[i] * (1 - 1e-12));
  }
  Launch launch{std::vector<double>(mean.size(), 0.75 / static_cast<double>(mean.size())), 0.25};
  const Moments steps = steps_from_launch(launch, mean, second);
  RC_ASSERT(steps.mean >= 1);
  RC_ASSERT(steps.sd >= 0);

  try {
    const QuasiStationary quasi = quasi_stationary(solver);
    RC_ASSERT(quasi.failure_rate > 0 && quasi.failure_rate <= 1);
    const double sum = std::accumulate(quasi.distribution.begin(), quasi.distribution.end(), 0.0);
    RC_ASSERT(std::abs(sum - 1) < 1e-12);
    for (const double p : quasi.distribution) RC_ASSERT(p >= 0);
    for (const double w : quasi.survival_weight) RC_ASSERT(w >= 0 && w <= 1);
  } catch (const NotUnique&) {  // some have classes of equal rates
  }
}

}  // namespace
}  // namespace metastable::markov
