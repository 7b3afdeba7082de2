#include "markov/passage/quasi_stationary.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

double sum(const std::vector<double>& v) { return std::accumulate(v.begin(), v.end(), 0.0); }

TEST(QuasiStationary, OneStateIsItsOwnDistribution) {
  for (const double kill : {1.0, 0.5, 1e-30}) {
    const ChainSolver solver(Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{kill}));
    const QuasiStationary quasi = quasi_stationary(solver);
    EXPECT_DOUBLE_EQ(quasi.failure_rate, kill);
    EXPECT_DOUBLE_EQ(quasi.revolution_failure_rate, kill);
    EXPECT_EQ(quasi.distribution, std::vector<double>{1});
    EXPECT_EQ(quasi.survival_weight, std::vector<double>{1});
  }
}

// A walk with rest at both ends has 1 - lambda_1 = 4 p sin^2(pi / (2 (n + 1))), left and right vectors are sines.
TEST(QuasiStationary, SymmetricWalkInClosedForm) {
  constexpr std::size_t n = 50;
  const double step = std::numbers::pi / (n + 1);
  const QuasiStationary quasi = quasi_stationary(ChainSolver(reference::birth_death(n, 0.25, 0.25, true)));
  EXPECT_NEAR(quasi.failure_rate / std::pow(std::sin(step / 2), 2), 1, 1e-13);
  double total = 0;
  for (std::size_t i = 0; i < n; ++i) total += std::sin(step * static_cast<double>(i + 1));
  for (std::size_t i = 0; i < n; ++i) {
    const double sine = std::sin(step * static_cast<double>(i + 1));
    EXPECT_NEAR(quasi.distribution[i] / (sine / total), 1, 1e-11);
    EXPECT_NEAR(quasi.survival_weight[i] / (sine / std::sin(step * n / 2)), 1, 1e-11);
  }
  EXPECT_GT(quasi.iterations, 1);
  EXPECT_LT(quasi.residual, 1e-11);
}

// The same walk without staying has period 2: lambda_1 = cos(pi / (n + 1)) per step.
TEST(QuasiStationary, WalkOfPeriodTwo) {
  constexpr std::size_t n = 51;
  const double step = std::numbers::pi / (n + 1);
  const ChainSolver solver(reference::birth_death(n, 0.5, 0.5, true));
  const QuasiStationary quasi = quasi_stationary(solver);
  EXPECT_NEAR(quasi.failure_rate / (2 * std::pow(std::sin(step / 2), 2)), 1, 1e-12);
  EXPECT_NEAR(quasi.revolution_failure_rate / std::pow(std::sin(step), 2), 1, 1e-12);
  EXPECT_NEAR(sum(quasi.distribution), 1, 1e-13);
  EXPECT_NEAR(*std::max_element(quasi.survival_weight.begin(), quasi.survival_weight.end()), 1, 1e-15);
  for (std::size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(quasi.survival_weight[i] / std::sin(step * static_cast<double>(i + 1)), 1, 1e-11);
  }
}

// y Q = lambda y for all classes at once; within each, shares sum to one.
TEST(QuasiStationary, OfACyclicChainIsAnEigenvectorOfTheWhole) {
  for (const double kill : {0.3, 0.999}) {
    const ChainSolver solver(reference::cyclic_chain(8, 3, 11, kill));
    const QuasiStationary quasi = quasi_stationary(solver);
    EXPECT_NEAR(sum(quasi.distribution), 1, 1e-14);
    const std::vector<double> next = apply_left(solver.chain(), quasi.distribution);
    for (std::size_t j = 0; j < next.size(); ++j)
      EXPECT_NEAR(next[j] / ((1 - quasi.failure_rate) * quasi.distribution[j]), 1, 1e-11) << kill;
    const std::vector<double> shares = shares_in_classes(solver.period(), quasi.distribution);
    for (const auto& states : solver.period().classes) {
      double mass = 0;
      for (const std::uint32_t i : states) mass += shares[i];
      EXPECT_NEAR(mass, 1, 1e-14);
    }
  }
  const ChainSolver solver(reference::cyclic_chain(8, 3, 11, 0.3));
  const QuasiStationary quasi = quasi_stationary(solver);
  // It holds lambda x = Q x for all classes at once.
  const std::vector<double> image = markov::apply(solver.chain(), quasi.survival_weight);
  for (std::size_t i = 0; i < image.size(); ++i) {
    EXPECT_NEAR(image[i], (1 - quasi.failure_rate) * quasi.survival_weight[i], 1e-13);
  }
}

TEST(QuasiStationary, FrequentRestNeedsFewIterations) {
  for (const double kill : {0.5, 0.99, 0.99999}) {
    const Chain chain = reference::random_chain(6, 2, kill);
    const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
    EXPECT_NEAR(quasi.failure_rate / reference::exact_failure_rate(chain), 1, 1e-13);
    EXPECT_LT(quasi.iterations, 100);
  }
}

TEST(QuasiStationary, ChainThatNeverReturnsFailsForCertain) {
  // The chain is 0 -> 1 or 3, 1 -> 2, 2 and 3 -> rest.
  const Chain chain({0, 2, 3, 3, 3}, {1, 3, 2}, {0.5, 0.5, 1}, {0, 0, 1, 1});
  const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
  EXPECT_EQ(quasi.failure_rate, 1);
  EXPECT_EQ(quasi.distribution, (std::vector<double>{0, 0, 1, 0}));
  EXPECT_EQ(quasi.survival_weight, (std::vector<double>{1, 0, 0, 0}));
}

TEST(QuasiStationary, EqualEigenvaluesInARow) {
  // In 0 -> 1 -> rest both stay with the same probability: a Jordan block.
  const Chain chain({0, 1, 1}, {1}, {0.5}, {0, 0.5});
  const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
  EXPECT_NEAR(quasi.failure_rate, 0.5, 1e-12);
  EXPECT_NEAR(quasi.distribution[1], 1, 1e-11);
  EXPECT_NEAR(quasi.survival_weight[1], 0, 1e-11);
}

// Fast launches fall through cells that hardly keep them, each about as likely as its neighbours: plain inverse
// iteration would take a million turns. Staying falls, a > b > ..., down to the last state, all triangular.
TEST(QuasiStationary, EigenvaluesThatDifferInTheSixthDigit) {
  constexpr std::size_t n = 12;
  std::vector<double> matrix(n * n, 0.0), kill(n, 0.0), stay(n);
  for (std::size_t i = 0; i < n; ++i) {
    stay[i] = 0.4 * (1 - 1e-6 * static_cast<double>(i));
    if (i + 1 < n) matrix[i * n + i + 1] = 0.3;
    kill[i] = 1 - stay[i] - matrix[i * n + (i + 1) % n];
  }
  const QuasiStationary quasi = quasi_stationary(ChainSolver(Chain::from_dense(n, matrix, kill)));
  EXPECT_NEAR(quasi.failure_rate, 0.6, 1e-13);
  std::vector<double> left(n, 1.0);  // left[i] (a - stay[i]) = left[i - 1] 0.3
  for (std::size_t i = 1; i < n; ++i) left[i] = left[i - 1] * 0.3 / (stay[0] - stay[i]);
  for (std::size_t i = n - 3; i < n; ++i) EXPECT_NEAR(quasi.distribution[i] / (left[i] / sum(left)), 1, 1e-8) << i;
  EXPECT_NEAR(quasi.survival_weight[0], 1, 1e-15);
  EXPECT_LT(quasi.iterations, 1000);
}

// Two groups of 60 states that mix at once and hardly change places: plain iterations of either look settled.
TEST(QuasiStationary, TellsLargeGroupsApartThatFadeAlike) {
  constexpr std::size_t half = 60, n = 2 * half;
  for (const double apart : {0.0, 1e-14, 1e-10, 1e-7}) {
    std::vector<double> matrix(n * n, 0.0), kill(n, 0.01);
    for (std::size_t i = 0; i < n; ++i) {
      if (i >= half) kill[i] += 0.01 * apart;
      for (std::size_t j = 0; j < n; ++j)
        if (i / half == j / half) matrix[i * n + j] = 0.5 / half;
    }
    const double over = 1e-15;
    matrix[half] = over;      // 0 -> 60
    matrix[half * n] = over;  // 60 -> 0
    const QuasiStationary quasi = quasi_stationary(ChainSolver(Chain::from_dense(n, matrix, kill)));
    // The groups as two states: exchange over / 60 either way, kill rates 0 and d.
    const double d = (kill[half] - kill[0]) / (over / half), ratio = 2 / (d + std::sqrt(d * d + 4));
    const double first = std::accumulate(quasi.distribution.begin(), quasi.distribution.begin() + half, 0.0);
    EXPECT_NEAR((1 - first) / first / ratio, 1, 1e-6) << apart;
    EXPECT_LT(quasi.residual, 1e-8) << apart;
  }
}

TEST(Stationary, TwoStatesAndARing) {
  const Chain two({0, 1, 2}, {1, 0}, {0.125, 0.5}, {0, 0});
  const std::vector<double> pi = stationary(two, std::vector<double>{0, 1});
  EXPECT_NEAR(pi[0], 0.8, 1e-15);
  EXPECT_NEAR(pi[1], 0.2, 1e-15);
  std::vector<double> ring(64, 0.0);
  for (std::size_t i = 0; i < 8; ++i) ring[i * 8 + (i + 1) % 8] = 1;
  for (const double p :
       stationary(Chain::from_dense(8, ring, std::vector<double>(8, 0.0)), std::vector<double>(8, 1.0))) {
    EXPECT_NEAR(p, 0.125, 1e-15);
  }
}

TEST(Stationary, TransientStatesGetNothing) {
  // The chain is 0 -> 1 -> 2 <-> 3; state 4 rests, but is not reached.
  const Chain chain({0, 1, 2, 3, 4, 4}, {1, 2, 3, 2}, {0.5, 1, 0.25, 0.5}, {0, 0, 0, 0, 1});
  const std::vector<double> pi = stationary(chain, std::vector<double>{1, 0, 0, 0, 0});
  EXPECT_EQ(pi[0] + pi[1] + pi[4], 0);
  EXPECT_NEAR(pi[2], 2.0 / 3, 1e-15);
  EXPECT_NEAR(pi[3], 1.0 / 3, 1e-15);
}

TEST(Stationary, IllegalInputs) {
  const Chain resting({0, 1, 1}, {1}, {1}, {0, 1});
  EXPECT_EQ(message_of<std::domain_error>([&] {
              stationary(resting, std::vector<double>{1, 0});
            }),
            "stationary distribution: rest can be reached (from state 1)");
  const Chain fork({0, 2, 2, 2}, {1, 2}, {0.5, 0.5}, {0, 0, 0});
  EXPECT_EQ(message_of<std::domain_error>([&] {
              stationary(fork, std::vector<double>{1, 0, 0});
            }),
            "stationary distribution: several closed classes can be reached (state 2 never leads to state 1)");
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              stationary(fork, std::vector<double>{0, 0, 0});
            }),
            "stationary distribution: the start has no mass");
}

TEST(StationaryWithRestart, IsInvariantUnderTheRestartedChain) {
  const ChainSolver solver(reference::random_chain(6, 9, 0.3));
  const std::vector<double> restart{0.2, 0, 0, 0.5, 0, 0.1};
  const std::vector<double> pi = stationary_with_restart(solver, restart);
  EXPECT_NEAR(sum(pi), 1, 1e-14);
  const std::vector<double> next = apply_left(solver.chain(), pi);
  const double resting = std::inner_product(pi.begin(), pi.end(), solver.chain().kill().begin(), 0.0);
  for (std::size_t i = 0; i < pi.size(); ++i) EXPECT_NEAR(next[i] + resting * restart[i] / 0.8, pi[i], 1e-14);
  EXPECT_EQ(message_of<std::invalid_argument>([&] { stationary_with_restart(solver, std::vector<double>(6, 0.0)); }),
            "stationary distribution with restart: the restart has no mass");
}

// Two states swap with probability 1/4 and never rest: the difference halves every step.
TEST(Mixing, GeometricDecayInClosedForm) {
  const ChainSolver solver(Chain({0, 1, 2}, {1, 0}, {0.25, 0.25}, {1e-15, 1e-15}));
  const QuasiStationary quasi = quasi_stationary(solver);
  const std::vector<double> start{1, 0};
  // The distance after t steps is 2^-(t + 1).
  EXPECT_EQ(total_variation_mixing(solver, quasi, start, 0.51), 0);
  EXPECT_EQ(total_variation_mixing(solver, quasi, start, 0.26), 1);
  EXPECT_EQ(total_variation_mixing(solver, quasi, start, 0.24), 2);
  EXPECT_EQ(total_variation_mixing(solver, quasi, start, 0.001), 9);
  EXPECT_EQ(total_variation_mixing(solver, quasi, start, 0.001, 5), std::nullopt);
}

// In metastable steps --method integrated --restitution 0.4,0.2 --friction 0.5,0 nobody survives for long, and what
// interpolated rows leave is rounding of either sign, here a circulant's complex pair.
TEST(QuasiStationary, EndsWhereInterpolatedRowsLeaveNobody) {
  const double on = 1e-17, back = -5e-18;
  const Chain chain =
      Chain::interpolated({0, 2, 4, 6}, {1, 2, 0, 2, 0, 1}, {on, back, back, on, on, back}, {1.0, 1.0, 1.0});
  const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
  EXPECT_NEAR(quasi.failure_rate, 1, 1e-15);
  EXPECT_LE(quasi.iterations, 100);
  EXPECT_EQ(total_variation_mixing(ChainSolver(chain), quasi, std::vector<double>{1, 0, 0}, 0.05), std::nullopt);
}

TEST(Mixing, CyclicChainMixesWithinItsClasses) {
  const ChainSolver solver(reference::cyclic_chain(4, 3, 5, 0.01));
  const QuasiStationary quasi = quasi_stationary(solver);
  std::vector<double> start(12, 0.0);
  start[1] = 1;
  const auto steps = total_variation_mixing(solver, quasi, start, 1e-6);
  ASSERT_TRUE(steps.has_value());
  EXPECT_GT(*steps, 1);
  EXPECT_LT(*steps, 40);
}

TEST(Mixing, IllegalInputs) {
  const ChainSolver solver(reference::random_chain(2, 1, 0.1));
  const QuasiStationary quasi = quasi_stationary(solver);
  EXPECT_EQ(
      message_of<std::invalid_argument>([&] { total_variation_mixing(solver, quasi, std::vector<double>(3), 0.1); }),
      "mixing: one start entry per state expected");
  EXPECT_EQ(
      message_of<std::invalid_argument>([&] { total_variation_mixing(solver, quasi, std::vector<double>(2), 0); }),
      "mixing: the distance must be positive");
}

TEST(SpectralMixing, ClosedFormAndLimits) {
  EXPECT_NEAR(spectral_mixing_steps(std::vector<double>{0.9, 0.45, 0.1}), 1 / std::log(2.0), 1e-15);
  EXPECT_EQ(spectral_mixing_steps(std::vector<double>{0.9}), 0);
  EXPECT_EQ(spectral_mixing_steps(std::vector<double>{0.9, 0}), 0);
  EXPECT_EQ(spectral_mixing_steps(std::vector<double>{0.9, 0.9}), std::numeric_limits<double>::infinity());
  EXPECT_EQ(message_of<std::invalid_argument>([] {
              spectral_mixing_steps(std::vector<double>{0.9, -1});
            }),
            "spectral mixing time: a modulus is negative or undefined");
}

}  // namespace
}  // namespace metastable::markov
