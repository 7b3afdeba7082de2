// Checks quasi-stationary distributions of chains that plain iteration does not settle: entry by entry against 400
// digits, over scales from 1e-300 to 1.

#include "markov/passage/leading_pair.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "markov/chain/solver.h"
#include "markov/passage/distribution_bound.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/exact_answers.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using Digits = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<400>, boost::multiprecision::et_off>;
using Matrix = std::vector<std::vector<Digits>>;

Matrix transposed(const Matrix& matrix) {
  Matrix other = matrix;
  for (std::size_t i = 0; i < matrix.size(); ++i)
    for (std::size_t j = 0; j < matrix.size(); ++j) other[i][j] = matrix[j][i];
  return other;
}

/// Finds the smallest eigenvalue of an irreducible generator by Noda's iteration as he wrote it.
Digits smallest(const Matrix& generator) {
  const std::size_t n = generator.size();
  std::vector<Digits> x(n, Digits(1));
  Digits shift = 0;
  for (int iteration = 0; iteration < 3000; ++iteration) {
    Digits low = -1, high = 0, largest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      Digits growth = 0;
      for (std::size_t j = 0; j < n; ++j) growth += generator[i][j] * x[j];
      growth /= x[i];
      if (low < 0 || growth < low) low = growth;
      if (growth > high) high = growth;
    }
    shift = low;
    if (high - low <= Digits("1e-330") * high) break;
    Matrix shifted = generator;
    for (std::size_t i = 0; i < n; ++i) shifted[i][i] -= shift * (1 - Digits("1e-360"));
    x = reference::gauss(shifted, x);
    for (const Digits& entry : x) largest = entry > largest ? entry : largest;
    for (Digits& entry : x) entry /= largest;
  }
  return shift;
}

struct Exact {
  Digits rate;
  std::vector<Digits> left, right;
};

/// Takes the least of the classes' eigenvalues, and one inverse iteration just below it.
Exact exact_pair(const Chain& chain, const std::vector<double>& kill) {
  Matrix generator = reference::generator<Digits>(chain);
  const std::size_t n = generator.size();
  for (std::size_t i = 0; i < n; ++i) generator[i][i] += Digits(kill[i]) - Digits(chain.kill(i));
  Exact exact{-1, {}, {}};
  for (const auto& states : communicating_classes(generator_of(chain))) {
    Matrix part;
    for (const std::uint32_t i : states) {
      part.emplace_back();
      for (const std::uint32_t j : states) part.back().push_back(generator[i][j]);
    }
    const Digits rate = smallest(part);
    if (exact.rate < 0 || rate < exact.rate) exact.rate = rate;
  }
  for (std::size_t i = 0; i < n; ++i) generator[i][i] -= exact.rate * (1 - Digits("1e-220"));
  const std::vector<Digits> ones(n, Digits(1));
  exact.right = reference::gauss(generator, ones);
  exact.left = reference::gauss(transposed(generator), ones);
  Digits sum = 0, largest = 0;
  for (const Digits& entry : exact.left) sum += entry;
  for (const Digits& entry : exact.right) largest = entry > largest ? entry : largest;
  for (Digits& entry : exact.left) entry /= sum;
  for (Digits& entry : exact.right) entry /= largest;
  return exact;
}

/// Returns the largest error of an entry, relative to the entry and what counts beside it.
double worst(const std::vector<double>& found, const std::vector<Digits>& exact, const Digits& beside) {
  double most = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Digits off = abs(Digits(found[i]) - exact[i]) / (exact[i] + beside);
    most = std::max(most, off.convert_to<double>());
  }
  return most;
}

std::vector<double> kill_rates(const Chain& chain) { return {chain.kill().begin(), chain.kill().end()}; }

/// Expects bounds of distribution and rate to hold what 400 digits say, where they say anything.
void expect_bounded(const Chain& chain, const QuasiStationary& quasi, const Exact& exact, int problem) {
  BoundedQuasiStationary found;
  found.quasi = quasi;
  const SplitVector left = split(quasi.distribution), weight = split(quasi.survival_weight);
  enclose_rate(chain, weight, found);
  bound_distribution(chain, left.rest, weight.rest, Way::eliminated, found);
  Digits apart = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) apart += abs(Digits(quasi.distribution[i]) - exact.left[i]) / 2;
  const Digits traces("1e-100");
  EXPECT_FALSE(apart > Digits(found.distribution_error)) << problem;
  EXPECT_FALSE(Digits(found.rate_lower) > exact.rate * (1 + traces)) << problem;
  EXPECT_FALSE(Digits(found.rate_upper) < exact.rate * (1 - traces)) << problem;
}

Chain random_kind(std::mt19937_64& engine, int kind) {
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(engine); };
  const auto n = static_cast<std::size_t>(2 + engine() % 5);
  const double exchange = kind == 1 ? -uniform(4, 25) : -1;  // nearly decoupled
  const double common = std::pow(10, -uniform(0.5, kind == 4 ? 90 : 12)), spread = std::pow(10, -uniform(0, 12));
  std::vector<double> matrix(n * n, 0.0), kill(n);
  for (std::size_t i = 0; i < n; ++i) {
    kill[i] =
        kind == 0 ? std::pow(10, -uniform(0.3, 60)) : common * (1 + (engine() % 3 == 0 ? 0 : spread * uniform(0, 1)));
    if (kind == 5 && engine() % 2 == 0) kill[i] = 0.4 * uniform(0, 1);
    for (std::size_t j = 0; j < n; ++j) {
      const bool there = kind == 2   ? (i + 1) % n == j || (i + n - 1) % n == j  // of period 2, if n is even
                         : kind == 3 ? j > i && engine() % 2 == 0                // transient, never returning
                                     : engine() % 3 != 0;
      const double size = kind == 4 ? std::pow(10, -uniform(0.5, 90)) : std::pow(10, exchange) * uniform(0.01, 1);
      if (i != j && there) matrix[i * n + j] = size * (kind == 2 ? 4 : 1) / static_cast<double>(n);
    }
  }
  kill[engine() % n] = std::max(kill[0], 0.01 * common);
  return Chain::from_dense(n, matrix, kill);
}

TEST(LeadingPair, HasEveryEntryOverAWideFamilyOfChains) {
  std::mt19937_64 engine(7);
  int found = 0;
  for (int problem = 0; problem < 240; ++problem) {
    const int kind = problem % 6;
    const Chain chain = random_kind(engine, kind);
    const Exact exact = exact_pair(chain, kill_rates(chain));
    try {
      const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
      // The exact vectors hold traces of others, 1e-220 over the relative distance of their rates. Where ways back are
      // as rare as 1e-90 (kind 4), two eigenvalues may differ by the root of that, and entries that small are lost.
      const Digits beside(kind == 4 ? "1" : "1e-150");
      const double off =
          std::max({worst(quasi.distribution, exact.left, beside), worst(quasi.survival_weight, exact.right, beside),
                    std::abs(quasi.failure_rate / exact.rate.convert_to<double>() - 1)});
      EXPECT_LT(off, (kind == 4 ? 1e-8 : 1e-12) + 4 * quasi.residual) << problem;
      expect_bounded(chain, quasi, exact, problem);
      ++found;
    } catch (const NotUnique& error) {
      // Either two classes have one rate, or failure rates of another rounding give another distribution.
      if (error.equal()) {
        EXPECT_EQ(chain.kill(error.one()), chain.kill(error.other())) << problem;
        continue;
      }
      if (kind == 4) continue;
      std::vector<double> other = kill_rates(chain);
      for (double& kill : other) kill *= 1 + 1e-13 * std::uniform_real_distribution<double>(-1, 1)(engine);
      const Exact moved = exact_pair(chain, other);
      double change = 0;
      for (std::size_t i = 0; i < other.size(); ++i)
        change = std::max(change, abs(moved.left[i] - exact.left[i]).convert_to<double>());
      EXPECT_GT(change, 1e-9) << problem;
    }
  }
  EXPECT_GT(found, 220);
}

QuasiStationary of(std::size_t n, const std::vector<double>& matrix, const std::vector<double>& kill) {
  return quasi_stationary(ChainSolver(Chain::from_dense(n, matrix, kill)));
}

TEST(LeadingPair, EqualKillRatesLeaveTheExchangeAlone) {
  for (const double exchange : {1e-2, 1e-5, 1e-12, 1e-100, 1e-290}) {
    const QuasiStationary quasi = of(2, {0, exchange, exchange / 10, 0}, {0.01, 0.01});
    EXPECT_NEAR(quasi.distribution[0] * 11, 1, 1e-13) << exchange;
    EXPECT_NEAR(quasi.distribution[1] * 1.1, 1, 1e-13) << exchange;
    EXPECT_EQ(quasi.failure_rate, 0.01);
  }
}

TEST(LeadingPair, GoesToThoseWhoLastLongest) {
  const QuasiStationary apart = of(2, {0, 0, 0, 0}, {0.1, 0.1 - 1e-9});
  EXPECT_EQ(apart.distribution, (std::vector<double>{0, 1}));
  EXPECT_EQ(apart.failure_rate, 0.1 - 1e-9);
  const QuasiStationary row = of(3, {0, 1e-100, 0, 0, 0, 1e-100, 0, 0, 0}, {0, 0, 1e-100});
  EXPECT_EQ(row.distribution, (std::vector<double>{0, 0, 1}));
  EXPECT_EQ(row.survival_weight, (std::vector<double>{1, 0, 0}));
  EXPECT_EQ(row.failure_rate, 1e-100);
}

// Two states that change places at a ten thousandth of their rates, which differ by two thousandths.
TEST(LeadingPair, RatesBelowRoundingOfOneCount) {
  for (const double rate : {1e-6, 1e-12, 1e-16, 1e-200}) {
    const QuasiStationary quasi = of(2, {0, rate * 1e-4, rate * 1e-4, 0}, {rate, rate * 1.002});
    // In units of the rate: x^2 + 20 x - 1 = 0 for x = y_1 / y_0.
    const double ratio = 1 / (10 + std::sqrt(101.0));
    EXPECT_NEAR(quasi.distribution[1] / quasi.distribution[0] / ratio, 1, 1e-11) << rate;
    EXPECT_GT(quasi.residual, 0) << rate;
    EXPECT_LT(quasi.residual, 1e-14) << rate;
  }
}

TEST(LeadingPair, SaysWhatIsNotUnique) {
  const auto message = [](std::size_t n, const std::vector<double>& matrix, const std::vector<double>& kill) {
    return message_of<NotUnique>([&] { of(n, matrix, kill); });
  };
  EXPECT_EQ(message(2, {0, 0, 0, 0}, {0.1, 0.1}),
            "the quasi-stationary distribution is not unique: survivors around state 0 and survivors around state 1 "
            "fade at the same rate (0.1), and neither kind leads to the other");
  // Two pairs, each mixed at once, with the same rates written in another order; and a way between them that
  // nobody takes.
  const std::vector<double> kill{1e-3, 3e-3, 3e-3, 1e-3};
  const double a = 0.3, b = 0.2, way = 1e-60;
  const std::vector<double> twins{0, a, 0, way, b, 0, 0, 0, 0, 0, 0, b, way, 0, a, 0};
  EXPECT_NE(message(4, twins, kill).find("double precision does not tell apart"), std::string::npos);
}

// The states of a chain of 60 cells over one revolution have other numbers; a period of 24 has one state a class.
TEST(LeadingPair, HoldsForAnyPeriod) {
  for (const std::size_t period : {2u, 3u, 24u}) {
    std::vector<double> matrix(period * period, 0.0), kill(period, 0.0);
    for (std::size_t i = 0; i < period; ++i) matrix[i * period + (i + 1) % period] = 1;
    matrix[(period - 1) * period] = 0.9;
    kill[period - 1] = 0.1;
    const QuasiStationary quasi = of(period, matrix, kill);
    const double lambda = std::pow(0.9, 1.0 / static_cast<double>(period));
    EXPECT_NEAR(quasi.failure_rate, 1 - lambda, 1e-15);
    double sum = 0;
    for (std::size_t i = 0; i + 1 < period; ++i) {
      EXPECT_NEAR(quasi.distribution[i] / lambda, quasi.distribution[i + 1], 1e-14);
      sum += quasi.distribution[i];
    }
    EXPECT_NEAR(sum + quasi.distribution.back(), 1, 1e-14);
  }
}

}  // namespace
}  // namespace metastable::markov
