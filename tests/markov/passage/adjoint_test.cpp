#include "markov/passage/adjoint.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"

namespace metastable::markov {
namespace {

Launch even_launch(const Chain& chain) {
  return {std::vector<double>(chain.size(), 0.9 / static_cast<double>(chain.size())), 0.1};
}

// Returns the chain with one off-diagonal entry and one kill rate multiplied; staying takes up the rest.
Chain changed(const Chain& chain, double factor) {
  const std::size_t n = chain.size();
  std::vector<double> matrix(n * n, 0.0), kill(chain.kill().begin(), chain.kill().end());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e) matrix[i * n + chain.columns(i)[e]] = chain.values(i)[e];
  matrix[1] *= factor;
  kill[n - 1] *= factor;
  return Chain::from_dense(n, matrix, kill);
}

double steps_in_rationals(const Chain& chain, const Launch& launch) {
  const std::vector<double> mean = reference::exact_means<reference::Rational>(chain);
  double steps = 1;
  for (std::size_t i = 0; i < chain.size(); ++i) steps += launch.after[i] * mean[i];
  return steps;
}

TEST(Adjoint, DerivativeOfRandomChainsToRationalAnswers) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Chain chain = reference::random_chain(2 + seed % 6, seed, std::pow(10.0, -static_cast<double>(seed)));
    const Launch launch = even_launch(chain);
    const Adjoint at = adjoint(ChainSolver(chain), launch);
    EXPECT_NEAR(at.steps / steps_in_rationals(chain, launch), 1, 1e-13);
    // M is a ratio of two functions linear in the factor: differences of size h miss its slope by a share h.
    const double h = 1e-4;
    const Chain low = changed(chain, 1 - h), high = changed(chain, 1 + h);
    const double exact = steps_in_rationals(high, launch) - steps_in_rationals(low, launch);
    EXPECT_NEAR(steps_change(at, low, launch, high, launch) / exact, 1, 1e-6) << seed;
  }
}

// It is m_i - m_reference of a walk away from rest, in exact arithmetic: from 1e3 to 1e60 steps the digits stay.
TEST(Adjoint, DifferencesOfMeansKeepTheirDigits) {
  for (const std::size_t n : {10, 60, 200}) {
    const Chain chain = reference::birth_death(n, 0.4, 0.2, false);
    Launch launch{std::vector<double>(n, 0.0), 0};
    launch.after[n / 2] = 1;
    const Adjoint at = adjoint(ChainSolver(chain), launch);
    const auto mean = reference::gauss(reference::generator<reference::Rational>(chain),
                                       std::vector<reference::Rational>(n, reference::Rational(1)));
    for (std::size_t i = 0; i < n; ++i) {
      const double exact = reference::Rational(mean[i] - mean[at.reference]).convert_to<double>();
      // They are two parts of the size of the time to the reference.
      EXPECT_NEAR(at.excess[i], exact, 1e-11 * (std::abs(exact) + 5.0 * static_cast<double>(n))) << n << ' ' << i;
    }
  }
}

TEST(Adjoint, CyclicChainsAndOneState) {
  const Chain ring = reference::cyclic_chain(4, 3, 5, 1e-3);
  const Launch launch = even_launch(ring);
  const Adjoint at = adjoint(ChainSolver(ring), launch);
  const std::vector<double> mean = reference::exact_means<reference::Rational>(ring);
  for (std::size_t i = 0; i < ring.size(); ++i) EXPECT_NEAR(at.excess[i], mean[i] - mean[at.reference], 1e-9 * mean[i]);

  const Chain one = Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{1e-8});
  const Chain more = Chain::from_dense(1, std::vector<double>{0}, std::vector<double>{1.000001e-8});
  const Launch start{{1.0}, 0};
  const Adjoint single = adjoint(ChainSolver(one), start);
  EXPECT_NEAR(steps_change(single, one, start, more, start) / -1e2, 1, 1e-9);
}

TEST(Adjoint, RefusesChainsOfOtherSizes) {
  const Chain chain = reference::random_chain(3, 1, 0.1), other = reference::random_chain(4, 1, 0.1);
  const Launch launch = even_launch(chain);
  const Adjoint at = adjoint(ChainSolver(chain), launch);
  EXPECT_THROW(steps_change(at, chain, launch, other, even_launch(other)), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
