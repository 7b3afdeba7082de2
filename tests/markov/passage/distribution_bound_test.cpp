// Bounds of quasi-stationary distributions, held against closed forms and 100 digits: never optimistic, and narrow
// where the chain allows it.

#include "markov/passage/distribution_bound.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "markov/chain/solver.h"
#include "tests/markov/exact_answers.h"
#include "tests/markov/sparse_chains.h"

namespace metastable::markov {
namespace {

using reference::Long;

using LongMatrix = std::vector<std::vector<Long>>;

/// Returns the right vector of the smallest eigenvalue of a matrix, sum one, to 50 digits.
std::vector<Long> exact_vector(const LongMatrix& matrix) {
  const std::size_t n = matrix.size();
  std::vector<Long> y(n, Long(1) / n);
  for (int iteration = 0; iteration < 4000; ++iteration) {
    std::vector<Long> next = reference::gauss(matrix, y);
    Long sum = 0, change = 0;
    for (const Long& entry : next) sum += entry;
    for (std::size_t i = 0; i < n; ++i) {
      next[i] /= sum;
      change += abs(next[i] - y[i]);
    }
    y = next;
    if (change < Long(1e-55)) break;
  }
  return y;
}

std::vector<Long> exact_distribution(const Chain& chain) {
  const LongMatrix matrix = reference::generator<Long>(chain);
  LongMatrix transposed = matrix;
  for (std::size_t i = 0; i < matrix.size(); ++i)
    for (std::size_t j = 0; j < matrix.size(); ++j) transposed[i][j] = matrix[j][i];
  return exact_vector(transposed);
}

/// Returns the largest relative error of the weights.
double true_weight_error(const BoundedQuasiStationary& found, const Chain& chain) {
  const std::vector<Long> exact = exact_vector(reference::generator<Long>(chain));
  const Long largest = *std::max_element(exact.begin(), exact.end());
  Long most = 0;
  for (std::size_t i = 0; i < exact.size(); ++i)
    most = std::max(most, Long(abs(Long(found.quasi.survival_weight[i]) * largest / exact[i] - 1)));
  return most.convert_to<double>();
}

double true_error(const BoundedQuasiStationary& found, const std::vector<Long>& exact) {
  Long sum = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) sum += abs(Long(found.quasi.distribution[i]) - exact[i]);
  return (sum / 2).convert_to<double>();
}

/// Takes the way of an eliminated chain: vectors in double precision.
BoundedQuasiStationary of_eliminated(const Chain& chain) {
  BoundedQuasiStationary found;
  found.quasi = quasi_stationary(ChainSolver(chain));
  const SplitVector left = split(found.quasi.distribution), weight = split(found.quasi.survival_weight);
  enclose_rate(chain, weight, found);
  bound_distribution(chain, left.rest, weight.rest, Way::eliminated, found);
  return found;
}

/// Two groups of states linked at random, one way as well as back by `coupling`, that fail at about `kill`.
Chain two_groups(std::size_t n, double coupling, double kill, std::mt19937_64& engine) {
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  std::vector<double> matrix(n * n, 0.0), rates(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    rates[i] = kill * uniform() * (i < n / 2 ? 1 : 3);
    for (std::size_t j = 0; j < n; ++j)
      if (i != j)
        matrix[i * n + j] = 0.6 * uniform() / static_cast<double>(n) * ((i < n / 2) == (j < n / 2) ? 1 : coupling);
  }
  return Chain::from_dense(n, matrix, rates);
}

void expect_held(const Chain& chain, double useful, const std::string& name) {
  const std::vector<Long> exact = exact_distribution(chain);
  Long rate = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) rate += exact[i] * Long(chain.kill(i));
  for (const BoundedQuasiStationary& found : {of_eliminated(chain), bounded_quasi_stationary(chain)}) {
    EXPECT_LE(true_error(found, exact), found.distribution_error) << name;
    EXPECT_LE(found.distribution_error, useful) << name << " " << found.unproven;
    EXPECT_EQ(found.unproven.empty(), std::isfinite(found.distribution_error)) << name;
    EXPECT_LE(true_weight_error(found, chain), found.weight_error) << name;
    if (*std::min_element(found.quasi.survival_weight.begin(), found.quasi.survival_weight.end()) > 0) {
      EXPECT_LE(found.weight_error, std::max(1e-12, useful * static_cast<double>(chain.size()))) << name;
    } else {
      EXPECT_EQ(found.weight_error, HUGE_VAL) << name;
    }
    EXPECT_LE(Long(found.rate_lower), rate) << name;
    EXPECT_GE(Long(found.rate_upper), rate) << name;
  }
}

TEST(DistributionBound, HoldsForRandomChainsThatAreNotReversible) {
  std::mt19937_64 engine(11);
  for (const double kill : {0.1, 1e-3, 1e-12})
    for (int problem = 0; problem < 6; ++problem) {
      const Chain chain = two_groups(4 + 2 * static_cast<std::size_t>(problem), 1, kill, engine);
      expect_held(chain, 1e-13, std::to_string(kill) + " " + std::to_string(problem));
    }
}

TEST(DistributionBound, GrowsWithTheTimeThatGroupsTakeToChangePlaces) {
  std::mt19937_64 engine(12);
  for (const double coupling : {1e-4, 1e-8, 1e-10, 1e-12})
    for (const double kill : {1e-6, 1e-12})
      for (int problem = 0; problem < 2; ++problem)
        expect_held(two_groups(10, coupling, kill, engine), std::max(1e-13, 1e-15 / coupling),
                    std::to_string(std::log10(coupling)) + " " + std::to_string(kill));
}

// A walk between failure and a wall, up with p and down with q: y_i falls like (p / q)^(i / 2) sin(i angle).
TEST(DistributionBound, HoldsForAWalkWhoseVectorIsKnown) {
  const std::size_t n = 40;
  const double up = 0.25, down = 0.5;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.0);
  kill.front() = down;
  kill.back() = up;  // fails at both ends
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0) matrix[i * n + i - 1] = down;
    if (i + 1 < n) matrix[i * n + i + 1] = up;
  }
  const BoundedQuasiStationary found = of_eliminated(Chain::from_dense(n, matrix, kill));
  std::vector<Long> exact;
  Long sum = 0;
  const Long angle = boost::math::constants::pi<Long>() / (n + 1);
  for (std::size_t i = 1; i <= n; ++i) {
    exact.push_back(pow(Long(up) / Long(down), Long(i) / 2) * sin(angle * i));
    sum += exact.back();
  }
  for (Long& entry : exact) entry /= sum;
  EXPECT_LE(true_error(found, exact), found.distribution_error);
  EXPECT_LE(found.distribution_error, 1e-12);
}

TEST(DistributionBound, CountsHowFarAVectorThatIsWrongIsOff) {
  std::mt19937_64 engine(13);
  for (const double coupling : {1.0, 1e-6}) {
    const Chain chain = two_groups(12, coupling, 1e-3, engine);
    const std::vector<Long> exact = exact_distribution(chain);
    BoundedQuasiStationary found = of_eliminated(chain);
    const SplitVector weight = split(found.quasi.survival_weight);
    found.quasi.distribution[0] += 1e-5;
    found.quasi.distribution[1] -= 1e-5;
    bound_distribution(chain, split(found.quasi.distribution).rest, weight.rest, Way::eliminated, found);
    EXPECT_LE(true_error(found, exact), found.distribution_error);
    EXPECT_NEAR(found.distribution_error / 1e-5, 1, 1e-3) << coupling;
  }
}

// Groups that change places so rarely that rounding decides which of them survivors are in.
TEST(DistributionBound, IsRefusedWhereGroupsHardlyChangePlaces) {
  std::mt19937_64 engine(14);
  const Chain chain = two_groups(8, 1e-3, 1e-3, engine);
  BoundedQuasiStationary found = of_eliminated(chain);
  const SplitVector left = split(found.quasi.distribution), weight = split(found.quasi.survival_weight);
  found.rate_lower = 0;  // nothing is known of the rate
  found.rate_upper = 1;
  bound_distribution(chain, left.rest, weight.rest, Way::eliminated, found);
  EXPECT_TRUE(std::isinf(found.distribution_error));
  EXPECT_NE(found.unproven.find("has no proven bound"), std::string::npos) << found.unproven;
  const BoundedQuasiStationary last =
      bounded_quasi_stationary(Chain::from_dense(2, std::vector<double>{0, 0.5, 0, 0}, std::vector<double>{0.5, 1}));
  EXPECT_TRUE(std::isinf(last.distribution_error));
  EXPECT_NE(last.unproven.find("no state is visited twice"), std::string::npos) << last.unproven;
}

// From the first group survivors slip into the last states, which lead to failure alone; others lead into the group.
TEST(DistributionBound, HoldsWhereSomeStatesDoNotLeadToOthers) {
  const std::vector<double> matrix{0, 0.3, 0.2, 0.1, 0,   0,     //
                                   0, 0,   0.4, 0,   0.1, 0,     //
                                   0, 0.3, 0,   0,   0,   1e-3,  //
                                   0, 0,   0,   0,   0.5, 0.2,   //
                                   0, 0,   0,   0.3, 0,   0.1,   //
                                   0, 0,   0,   0,   0,   0};
  const Chain chain = Chain::from_dense(6, matrix, std::vector<double>{0.2, 1e-3, 0, 0.1, 0.2, 0.9});
  expect_held(chain, 1e-13, "reducible");
}

TEST(DistributionBound, OfOneStateThereIsOneDistribution) {
  const BoundedQuasiStationary found = of_eliminated(Chain({0, 0}, {}, {}, {0.001}));
  EXPECT_EQ(found.distribution_error, 0);
  EXPECT_TRUE(found.unproven.empty());
}

// 1100 states that fill in: eliminated in double precision, as extended precision takes longer, and iterated.
TEST(DistributionBound, IsNarrowForLargeChainsEitherWay) {
  const Chain chain = reference::sparse_chain({1100, 7, 1e-6, 1, 1e-9, 0});
  const BoundedQuasiStationary iterated = bounded_quasi_stationary(chain, Heard([] {}, 0)),
                               eliminated = of_eliminated(chain);
  EXPECT_LE(iterated.distribution_error, 1e-6) << iterated.unproven;
  EXPECT_LE(eliminated.distribution_error, 1e-6) << eliminated.unproven;
  double apart = 0;
  for (std::size_t i = 0; i < chain.size(); ++i)
    apart += std::abs(iterated.quasi.distribution[i] - eliminated.quasi.distribution[i]) / 2;
  EXPECT_LE(apart, iterated.distribution_error + eliminated.distribution_error);
  EXPECT_LE(iterated.rate_upper / iterated.rate_lower - 1, 1e-9);
  EXPECT_LE(eliminated.rate_upper / eliminated.rate_lower - 1, 1e-9);
}

}  // namespace
}  // namespace metastable::markov
