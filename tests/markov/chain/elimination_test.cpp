#include "markov/chain/elimination.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

std::vector<double> ones(std::size_t n) { return std::vector<double>(n, 1.0); }

/// Returns the largest relative residual of (I - Q) x = rhs in 100 digits.
double residual(const Chain& chain, const std::vector<double>& x, const std::vector<double>& rhs) {
  double worst = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    reference::Long inflow = rhs[i], outflow = chain.kill(i) * reference::Long(x[i]);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e) {
      const reference::Long probability = chain.values(i)[e];
      inflow += probability * x[chain.columns(i)[e]];
      outflow += probability * x[i];
    }
    worst = std::max(worst, abs(inflow / outflow - 1).convert_to<double>());
  }
  return worst;
}

TEST(Elimination, OneState) {
  const Elimination elimination(Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{1e-300}));
  EXPECT_DOUBLE_EQ(elimination.solve(ones(1))[0], 1e300);
  EXPECT_DOUBLE_EQ(elimination.solve_left(ones(1))[0], 1e300);
}

// A symmetric walk with rest at both ends has m_i = (i + 1) (n - i) / (2 p).
TEST(Elimination, SymmetricWalkInClosedForm) {
  for (const std::size_t n : {2, 7, 300}) {
    const Elimination elimination(reference::birth_death(n, 0.25, 0.25, true));
    const std::vector<double> mean = elimination.solve(ones(n));
    const std::vector<double> visits = elimination.solve_left(ones(n));  // the same numbers: the chain is symmetric
    for (std::size_t i = 0; i < n; ++i) {
      const double exact = static_cast<double>((i + 1) * (n - i)) / 0.5;
      EXPECT_NEAR(mean[i] / exact, 1, 1e-13);
      EXPECT_NEAR(visits[i] / exact, 1, 1e-13);
    }
  }
}

// The drift is away from rest: the expected time from i to i - 1 is a sum of positive terms.
TEST(Elimination, KeepsAllDigitsWhenRestTakes1e60Steps) {
  constexpr std::size_t n = 600;
  const double up = 0.4, down = 0.2;
  const Chain chain = reference::birth_death(n, up, down, false);
  const std::vector<double> mean = Elimination(chain).solve(ones(n));
  std::vector<double> descent(n);
  descent[n - 1] = 1 / down;
  for (std::size_t i = n - 1; i-- > 0;) descent[i] = (1 + up * descent[i + 1]) / down;
  double exact = 0;
  for (std::size_t i = 0; i < n; ++i) {
    exact += descent[i];
    EXPECT_NEAR(mean[i] / exact, 1, 1e-12) << i;
  }
  EXPECT_GT(mean[0], 1e60);
}

TEST(Elimination, RandomChainsToRationalAnswers) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    const std::size_t n = 1 + seed % 8;
    const Chain chain = reference::random_chain(n, seed, std::pow(10.0, -static_cast<double>(seed)));
    const std::vector<double> exact = reference::exact_means<reference::Rational>(chain);
    const std::vector<double> mean = Elimination(chain).solve(ones(n));
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(mean[i] / exact[i], 1, 1e-14) << "seed " << seed;
  }
}

// The sizes lie on both sides of the blocks of the blocked elimination, and are not multiples of them.
TEST(Elimination, BlockedAndRowByRowAgree) {
  for (const std::size_t n : {127, 128, 129, 192, 250, 256, 257, 321, 601}) {
    const Chain chain = reference::random_chain(n, static_cast<unsigned>(n), 1e-9);
    const Elimination elimination(chain);
    std::vector<double> rhs(n);
    for (std::size_t i = 0; i < n; ++i) rhs[i] = static_cast<double>(i % 7);
    EXPECT_LT(residual(chain, elimination.solve(rhs), rhs), 1e-13) << n;
    // <left, 1> of the left solution with rhs r equals <r, right> of the right solution with rhs 1.
    const std::vector<double> right = elimination.solve(ones(n));
    const std::vector<double> left = elimination.solve_left(rhs);
    const double one = std::accumulate(left.begin(), left.end(), 0.0);
    const double other = std::inner_product(rhs.begin(), rhs.end(), right.begin(), 0.0);
    EXPECT_NEAR(one / other, 1, 1e-12) << n;
  }
}

TEST(Elimination, BitsDoNotDependOnThreads) {
  for (const std::size_t n : {333, 601}) {
    const Chain chain = reference::random_chain(n, 7, 1e-6);
    const std::vector<double> one = Elimination(chain, 1).solve(ones(n)), three = Elimination(chain, 3).solve(ones(n));
    EXPECT_EQ(one, three) << n;
  }
}

// The rare exits (1e-25) of a full chain, larger than a block, are all in one state: symmetry gives a closed form.
TEST(Elimination, BlockedKeepsAllDigitsWhenRestIsRare) {
  constexpr std::size_t n = 200;
  std::vector<double> matrix(n * n, 1.0 / n), kill(n, 0.0);
  kill[17] = 1e-25;
  const std::vector<double> mean = Elimination(Chain::from_dense(n, matrix, kill)).solve(ones(n));
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(mean[i] / (n / 1e-25), 1, 1e-13);
}

// Eliminating a state links all that lead to it with all it leads to, beyond the envelope of the entries.
TEST(Elimination, FillOutsideTheEnvelopeOfTheEntries) {
  const std::size_t n = 6;
  std::vector<double> matrix(n * n, 0.0);
  matrix[3 * n + 5] = 0.5, matrix[4 * n + 5] = 0.25, matrix[5 * n + 0] = 0.75;
  matrix[0 * n + 4] = 0.5, matrix[0 * n + 3] = 0.25, matrix[1 * n + 2] = 1, matrix[2 * n + 4] = 1;
  const std::vector<double> kill{0, 0, 0, 0.125, 0.0625, 0};
  const Chain chain = Chain::from_dense(n, matrix, kill);
  const std::vector<double> exact = reference::exact_means<reference::Rational>(chain);
  const std::vector<double> mean = Elimination(chain).solve(ones(n));
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(mean[i] / exact[i], 1, 1e-15);
}

TEST(Elimination, MillionStatesOfBandwidthThree) {
  constexpr std::size_t n = 1000000;
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(n, 1e-7);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i < 3 ? 0 : i - 3; j <= std::min(n - 1, i + 3); ++j) {
      if (j == i) continue;
      column.push_back(static_cast<std::uint32_t>(j));
      value.push_back(j < i ? 0.1 : 0.15);
    }
    start.push_back(column.size());
  }
  const std::vector<double> mean =
      Elimination(Chain(std::move(start), std::move(column), std::move(value), std::move(kill))).solve(ones(n));
  for (std::size_t i = 0; i < n; i += 9973) EXPECT_NEAR(mean[i] * 1e-7, 1, 1e-10);  // everywhere the same hazard
}

TEST(Elimination, SolutionsArePositiveExactlyWhereTheyShouldBe) {
  // In 0 -> 1 -> 2 -> rest these are the visits of a start in 1.
  const Chain chain({0, 1, 2, 2}, {1, 2}, {1, 1}, {0, 0, 1});
  const Elimination elimination(chain);
  EXPECT_EQ(elimination.solve_left(std::vector<double>{0, 1, 0}), (std::vector<double>{0, 1, 1}));
  EXPECT_EQ(elimination.solve(std::vector<double>{0, 1, 0}), (std::vector<double>{1, 1, 0}));
}

TEST(Elimination, IllegalInputs) {
  const Chain stuck({0, 1, 2, 3}, {1, 2, 1}, {1, 1, 1}, {0, 0, 0});
  EXPECT_EQ(message_of<std::domain_error>([&] { Elimination{stuck}; }),
            "elimination: rest cannot be reached from state 0");
  const Elimination elimination(reference::birth_death(3, 0.25, 0.25, true));
  EXPECT_EQ(elimination.size(), 3u);
  EXPECT_EQ(message_of<std::invalid_argument>([&] { elimination.solve(ones(2)); }),
            "elimination: right side of size 2 for 3 states");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              elimination.solve_left(std::vector<double>{1, -1, 0});
            }),
            "elimination: entry 1 of the right side is -1.000000, not a finite number >= 0");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              elimination.solve(std::vector<double>{1, std::nan(""), 0});
            }),
            "elimination: entry 1 of the right side is nan, not a finite number >= 0");
}

TEST(Elimination, FullChainsThatCannotRest) {
  constexpr std::size_t n = 300, open = 120;  // the states from `open` on never leave each other
  std::vector<double> matrix(n * n), kill(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t first = i < open ? 0 : open;
    std::fill(matrix.begin() + static_cast<std::ptrdiff_t>(i * n + first),
              matrix.begin() + static_cast<std::ptrdiff_t>((i + 1) * n), 0.5 / n);
    if (i < open) kill[i] = 0.5;
  }
  const Chain chain = Chain::from_dense(n, matrix, kill);
  EXPECT_EQ(message_of<std::domain_error>([&] { Elimination{chain}; }),
            "elimination: rest cannot be reached from state 120");
}

TEST(Elimination, TimesBeyondDoubleAreAnErrorNotInfinity) {
  const Elimination rare(Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{1e-300}));
  EXPECT_EQ(message_of<ConvergenceError>([&] { rare.solve(std::vector<double>{1e10}); }),
            "elimination did not converge: the solution exceeds the range of double precision");
  const Chain rarer = Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{1e-310});
  EXPECT_EQ(message_of<ConvergenceError>([&] { Elimination{rarer}; }),
            "elimination did not converge: residual 1e-310: state 0 is left too rarely for double precision");
}

}  // namespace
}  // namespace metastable::markov
