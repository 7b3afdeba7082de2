#include "markov/chain/eigenpairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

// Belongs to a walk with rest at both ends: lambda_k = stay + 2 sqrt(up down) cos(k pi / (n + 1)).
double walk_eigenvalue(std::size_t n, double up, double down, int k) {
  return 1 - up - down + 2 * std::sqrt(up * down) * std::cos(k * std::numbers::pi / static_cast<double>(n + 1));
}

TEST(LeadingEigenpairs, WalkInClosedForm) {
  for (const std::size_t n : {2, 3, 5, 15, 16, 17, 60}) {
    for (const int count : {1, 2, 5, 14}) {
      const Eigenpairs pairs = leading_eigenpairs(reference::birth_death(n, 0.2, 0.3, true), count);
      ASSERT_EQ(pairs.values.size(), std::min(n, static_cast<std::size_t>(count)));
      for (std::size_t k = 0; k < pairs.values.size(); ++k) {
        EXPECT_NEAR(pairs.values[k].real(), walk_eigenvalue(n, 0.2, 0.3, static_cast<int>(k) + 1), 1e-12);
        EXPECT_EQ(pairs.values[k].imag(), 0);
      }
    }
  }
}

TEST(LeadingEigenpairs, LeftVectorIsADistribution) {
  for (const std::size_t n : {1, 8, 100}) {
    const Eigenpairs pairs = leading_eigenpairs(reference::random_chain(n, 5, 0.2), 1);
    EXPECT_NEAR(std::accumulate(pairs.left.begin(), pairs.left.end(), 0.0), 1, 1e-14);
    for (const double p : pairs.left) EXPECT_GE(p, 0);
    EXPECT_LT(pairs.residual, 1e-13);
  }
}

// A drifting ring has complex eigenvalues; no half of a pair is returned.
TEST(LeadingEigenpairs, ConjugatePairsStayTogether) {
  constexpr std::size_t n = 40;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.01);
  for (std::size_t i = 0; i < n; ++i) matrix[i * n + (i + 1) % n] = 0.5;
  const Chain chain = Chain::from_dense(n, matrix, kill);
  for (const int count : {1, 2, 3, 4, 5}) {
    const Eigenpairs pairs = leading_eigenpairs(chain, count);
    ASSERT_EQ(pairs.values.size(), static_cast<std::size_t>(count % 2 == 0 ? count + 1 : count));
    EXPECT_NEAR(pairs.values[0].real(), 0.99, 1e-13);
    for (std::size_t k = 1; k + 1 < pairs.values.size(); k += 2) {
      EXPECT_NEAR(std::abs(pairs.values[k] - std::conj(pairs.values[k + 1])), 0, 1e-13);
      // It is lambda_k = 0.49 + 0.5 exp(2 pi i k / n).
      const auto angle = 2 * std::numbers::pi * static_cast<double>((k + 1) / 2) / n;
      EXPECT_NEAR(std::abs(pairs.values[k] - (0.49 + std::polar(0.5, angle))), 0, 1e-12);
    }
  }
}

// 1 - lambda_1 is below rounding, lambda_2 is not lost with it.
TEST(LeadingEigenpairs, SecondEigenvalueWhenRestIsRare) {
  constexpr std::size_t n = 30;
  std::vector<double> matrix(n * n, 0.5 / n), kill(n, 1e-20);
  const Eigenpairs pairs = leading_eigenpairs(Chain::from_dense(n, matrix, kill), 2);
  EXPECT_NEAR(pairs.values[0].real(), 1, 1e-14);
  EXPECT_NEAR(std::abs(pairs.values[1]), 0.5, 1e-12);
}

TEST(LeadingEigenpairs, IllegalInputs) {
  EXPECT_EQ(message_of<std::invalid_argument>([] { leading_eigenpairs(Chain{}, 1); }),
            "eigenpairs: at least one state and one eigenvalue expected");
  EXPECT_EQ(message_of<std::invalid_argument>([] { leading_eigenpairs(reference::random_chain(3, 1, 0.1), 0); }),
            "eigenpairs: at least one state and one eigenvalue expected");
}

}  // namespace
}  // namespace metastable::markov
