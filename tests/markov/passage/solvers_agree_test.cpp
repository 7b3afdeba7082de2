// Puts the same problems through every solver, against exact answers.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "markov/chain/eigenpairs.h"
#include "markov/chain/solver.h"
#include "markov/chain/sparse_solver.h"
#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"

namespace metastable::markov {
namespace {

/// Returns the rate per step of a chain of which one revolution fails at `rate`.
double per_step(double rate, int period) { return -std::expm1(std::log1p(-rate) / period); }

/// Has full relative accuracy however rare rest is.
struct SubtractionFree {
  static double failure_rate(const Chain& chain) { return quasi_stationary(ChainSolver(chain)).failure_rate; }
  static std::optional<std::vector<double>> means(const Chain& chain) { return mean_first_passage(ChainSolver(chain)); }
  static double tolerance(double) { return 1e-12; }
};

/// Loses the digits that 1 - lambda_1 loses to rounding: about 1e-15 / (1 - lambda_1).
struct Klu {
  static double failure_rate(const Chain& chain) {
    const SparseSolver solver(chain);
    std::vector<double> y(chain.size(), 1.0 / static_cast<double>(chain.size()));
    double rate = 0;
    for (double change = 1; change > 1e-15;) {
      y = solver.solve_left(y);
      const double sum = std::accumulate(y.begin(), y.end(), 0.0);
      for (double& entry : y) entry /= sum;
      change = std::abs(rate - 1 / sum);
      rate = 1 / sum;
    }
    return rate;
  }
  static std::optional<std::vector<double>> means(const Chain& chain) {
    return SparseSolver(chain).solve(std::vector<double>(chain.size(), 1.0));
  }
  static double tolerance(double rate) { return 1e-12 + 1e-14 / rate; }
};

/// Finds lambda_1 to an absolute 1e-14; no first passage. Cyclic chains go by the revolution.
struct Arnoldi {
  static double failure_rate(const Chain& chain) {
    const Period period = find_period(chain);
    return per_step(1 - leading_eigenpairs(revolution_chain(chain, period), 1).values[0].real(), period.period);
  }
  static std::optional<std::vector<double>> means(const Chain&) { return std::nullopt; }
  static double tolerance(double rate) { return 1e-12 + 3e-14 / rate; }
};

template <typename Solver>
class SolversAgree : public ::testing::Test {
 protected:
  /// A tolerance of one and more promises nothing; an honest refusal is then as good as any number.
  static void check(const Chain& chain, double exact_rate, const std::vector<double>& exact_means) {
    const double tolerance = Solver::tolerance(exact_rate);
    try {
      const double rate = Solver::failure_rate(chain);
      const auto means = Solver::means(chain);
      if (tolerance >= 1) return;
      EXPECT_NEAR(rate / exact_rate, 1, tolerance) << "rate " << exact_rate;
      if (!means) return;
      ASSERT_EQ(means->size(), exact_means.size());
      for (std::size_t i = 0; i < means->size(); ++i) EXPECT_NEAR((*means)[i] / exact_means[i], 1, tolerance) << i;
    } catch (const ConvergenceError&) {
      if (tolerance < 1) throw;
    }
  }
  static void check(const Chain& chain) {
    check(chain, reference::exact_failure_rate(chain), reference::exact_means<reference::Rational>(chain));
  }
};

using Solvers = ::testing::Types<SubtractionFree, Klu, Arnoldi>;
TYPED_TEST_SUITE(SolversAgree, Solvers);

TYPED_TEST(SolversAgree, OneState) {
  for (const double kill : {0.5, 1e-3, 1e-9}) {
    this->check(Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{kill}), kill, {1 / kill});
  }
}

// It has 1 - lambda_1 = 4 p sin^2(pi / (2 (n + 1))), m_i = (i + 1) (n - i) / (2 p)
TYPED_TEST(SolversAgree, GamblersRuinWithAndWithoutStaying) {
  for (const std::size_t n : {2, 10, 101}) {
    for (const double p : {0.5, 0.3}) {
      std::vector<double> means(n);
      for (std::size_t i = 0; i < n; ++i) means[i] = static_cast<double>((i + 1) * (n - i)) / (2 * p);
      const double sine = std::sin(std::numbers::pi / (2 * static_cast<double>(n + 1)));
      this->check(reference::birth_death(n, p, p, true), 4 * p * sine * sine, means);
    }
  }
}

TYPED_TEST(SolversAgree, UnfairGame) { this->check(reference::birth_death(8, 0.5, 0.25, true)); }

TYPED_TEST(SolversAgree, RandomChains) {
  for (unsigned seed = 0; seed < 24; ++seed) {
    this->check(reference::random_chain(1 + seed % 8, seed, std::pow(10.0, -static_cast<double>(seed % 6))));
  }
}

TYPED_TEST(SolversAgree, CyclicChains) {
  this->check(reference::cyclic_chain(3, 2, 1, 0.3));
  this->check(reference::cyclic_chain(8, 1, 2, 1e-3));
  this->check(reference::cyclic_chain(2, 4, 3, 1e-5));
}

// There are two halves of three states that exchange 1e-9 and rest at 1e-3 and 1e-4.
TYPED_TEST(SolversAgree, NearlyDecomposable) {
  std::vector<double> matrix(36, 0.0), kill(6);
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) matrix[i * 6 + j] = i / 3 == j / 3 ? 0.3 : 1e-9 * static_cast<double>(1 + j);
    kill[i] = i < 3 ? 1e-3 : 1e-4;
  }
  this->check(Chain::from_dense(6, matrix, kill));
}

TYPED_TEST(SolversAgree, FailureRateOf1e13th) {
  const Chain chain = reference::birth_death(8, 0.9, 0.018, false);
  const double exact = reference::exact_failure_rate(chain);
  EXPECT_GT(exact, 1e-14);
  EXPECT_LT(exact, 1e-12);
  this->check(chain, exact, reference::exact_means<reference::Rational>(chain));
}

TYPED_TEST(SolversAgree, FailureRateOf1e20th) {
  const Chain chain = reference::birth_death(8, 0.9, 0.0025, false);
  const double exact = reference::exact_failure_rate(chain);
  EXPECT_GT(exact, 1e-21);
  EXPECT_LT(exact, 1e-19);
  this->check(chain, exact, reference::exact_means<reference::Rational>(chain));
}

}  // namespace
}  // namespace metastable::markov
