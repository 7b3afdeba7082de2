// Tries chains nobody thought of: random ones against exact rational answers, and the shapes that break solvers.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include "markov/chain/solver.h"
#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/discretization.h"
#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"

namespace metastable::markov {
namespace {

using reference::Rational;

// Makes random sparse rows over many orders of magnitude. `period` > 1: classes i % period lead to the next class only.
// `groups` > 1: all between groups i % groups is multiplied by `coupling`. Every state of a class or group has a way
// on.
struct Shape {
  std::size_t states = 1, period = 1, groups = 1;
  double coupling = 1, rarest = 1e-3;
};
Chain random_sparse(const Shape& shape, unsigned seed) {
  const std::size_t n = shape.states;
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const bool allowed = shape.period == 1 || j % shape.period == (i + 1) % shape.period;
      if (!allowed || (uniform(engine) > 0.3 && j != (i + 1) % n)) continue;
      matrix[i * n + j] = std::pow(10, -9 * uniform(engine));
      if (i % shape.groups != j % shape.groups) matrix[i * n + j] *= shape.coupling;
    }
    if (i == 0 || uniform(engine) < 0.3) kill[i] = std::pow(shape.rarest, uniform(engine));
    const double sum = std::accumulate(matrix.begin() + static_cast<std::ptrdiff_t>(i * n),
                                       matrix.begin() + static_cast<std::ptrdiff_t>((i + 1) * n), kill[i]);
    if (sum == 0) {
      kill[i] = 1;
      continue;
    }
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] /= sum;
    kill[i] /= sum;
  }
  return Chain::from_dense(n, matrix, kill);
}

// Checks means and visits to every digit but the last few.
void expect_exact(const Chain& chain) {
  const ChainSolver solver(chain);
  const std::size_t n = chain.size();
  const auto matrix = reference::generator<Rational>(chain);
  const auto exact_mean = reference::gauss(matrix, std::vector<Rational>(n, Rational(1)));
  auto transposed = matrix;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) transposed[i][j] = matrix[j][i];
  const auto exact_visits = reference::gauss(transposed, std::vector<Rational>(n, Rational(1)));
  const std::vector<double> mean = mean_first_passage(solver);
  const std::vector<double> visits = solver.solve_left(std::vector<double>(n, 1.0));
  // A cyclic chain's stored rows add up to 1 but for rounding, which the revolution spreads.
  const double tolerance = 1e-13 * solver.period().period;
  for (std::size_t i = 0; i < n; ++i) {
    RC_ASSERT(std::isfinite(mean[i]) && std::isfinite(visits[i]));
    RC_ASSERT(abs(Rational(mean[i]) / exact_mean[i] - 1) < Rational(tolerance));
    RC_ASSERT(abs(Rational(visits[i]) / exact_visits[i] - 1) < Rational(tolerance));
  }
}

RC_GTEST_PROP(ChainProperty, SparseChainsToRationalAnswers, ()) {
  const Shape shape{.states = *rc::gen::inRange<std::size_t>(1, 12),
                    .rarest = std::pow(10.0, -*rc::gen::inRange(0, 60))};
  expect_exact(random_sparse(shape, *rc::gen::arbitrary<unsigned>()));
}

RC_GTEST_PROP(ChainProperty, NearlyDecomposableChainsToRationalAnswers, ()) {
  const Shape shape{.states = *rc::gen::inRange<std::size_t>(4, 12),
                    .groups = *rc::gen::inRange<std::size_t>(2, 4),
                    .coupling = std::pow(10.0, -*rc::gen::inRange(1, 40)),
                    .rarest = std::pow(10.0, -*rc::gen::inRange(0, 20))};
  expect_exact(random_sparse(shape, *rc::gen::arbitrary<unsigned>()));
}

RC_GTEST_PROP(ChainProperty, PeriodicChainsToRationalAnswers, ()) {
  const std::size_t period = *rc::gen::inRange<std::size_t>(2, 5);
  const Shape shape{.states = period * *rc::gen::inRange<std::size_t>(1, 4),
                    .period = period,
                    .rarest = std::pow(10.0, -*rc::gen::inRange(0, 12))};
  const Chain chain = random_sparse(shape, *rc::gen::arbitrary<unsigned>());
  RC_ASSERT(find_period(chain).period % static_cast<int>(period) == 0 || chain.entries() == 0);
  expect_exact(chain);
}

// Rest out of reach from somewhere is refused by name, never a number.
RC_GTEST_PROP(ChainProperty, UnreachableRestIsRefused, ()) {
  const auto n = *rc::gen::inRange<std::size_t>(2, 12);
  const Chain whole = random_sparse({.states = n}, *rc::gen::arbitrary<unsigned>());
  const std::size_t trapped = *rc::gen::inRange<std::size_t>(1, n);  // the first ones only lead to each other
  std::vector<double> matrix(n * n, 0.0), kill(whole.kill().begin(), whole.kill().end());
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t e = 0; e < whole.columns(i).size(); ++e)
      if (i >= trapped || whole.columns(i)[e] < trapped) matrix[i * n + whole.columns(i)[e]] = whole.values(i)[e];
    if (i < trapped) kill[i] = 0;
  }
  const Chain chain = Chain::from_dense(n, matrix, kill);
  RC_ASSERT(!classify(chain).can_rest[0]);
  RC_ASSERT_THROWS_AS(ChainSolver{chain}, std::domain_error);
}

struct ShiftMap {  // x' = x / 2 + 1 + z, rest below zero
  std::pair<double, double> state_interval(int) const { return {0.0, INFINITY}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int, std::span<const double> noise) const {
    const double next = 0.5 * state + 1 + noise[0];
    if (next < 0) return std::nullopt;
    return next;
  }
};

TEST(ChainShapes, OneCell) {
  const LaunchState launch{[](double) { return 2.0; }, 0};
  const StateSpace space = covering_space(ShiftMap{}, launch, 1, 1);
  const SampledChain sampled = discretize(ShiftMap{}, space, launch, {});
  ASSERT_EQ(sampled.chain.size(), 1u);
  const ChainSolver solver(sampled.chain);
  EXPECT_DOUBLE_EQ(mean_first_passage(solver)[0], 1 / sampled.chain.kill(0));
  EXPECT_DOUBLE_EQ(quasi_stationary(solver).failure_rate, sampled.chain.kill(0));
}

// It goes up by 0.15, down by 0.1, three cells each way, everywhere with the same hazard: all answers in closed form.
TEST(ChainShapes, AMillionCellsBanded) {
  constexpr std::size_t n = 1000000;
  constexpr double hazard = 1e-9;
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i < 3 ? 0 : i - 3; j <= std::min(n - 1, i + 3); ++j) {
      if (j == i) continue;
      column.push_back(static_cast<std::uint32_t>(j));
      value.push_back(j < i ? 0.1 : 0.15);
    }
    start.push_back(column.size());
  }
  const ChainSolver solver(Chain(std::move(start), std::move(column), std::move(value), std::vector(n, hazard)));
  const std::vector<double> mean = mean_first_passage(solver);
  std::vector<double> launch(n, 0.0);
  launch[n / 2] = 1;
  const std::vector<double> visits = solver.solve_left(launch);
  double killed = 0;
  for (std::size_t i = 0; i < n; ++i) {
    ASSERT_NEAR(mean[i] * hazard, 1, 1e-8) << i;
    ASSERT_GE(visits[i], 0);
    killed += visits[i] * hazard;
  }
  EXPECT_NEAR(killed, 1, 1e-8);
}

}  // namespace
}  // namespace metastable::markov
