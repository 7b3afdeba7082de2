// Takes the rough-terrain rimless wheel of Byl and Tedrake ("Metastable walking machines", IJRR 28, 2009) as an
// end-to-end test of the solvers: its integral equation on Gauss-Legendre nodes, against values computed to 60 digits.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <ostream>
#include <string>

#include "markov/chain/solver.h"
#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {
namespace {

using std::numbers::pi;

struct Rule {
  std::vector<double> node, weight;
};

/// Returns Gauss-Legendre on [lower, upper], by Newton's method on the three-term recurrence.
Rule gauss_legendre(int n, double lower, double upper) {
  Rule rule;
  for (int k = n; k-- > 0;) {
    double x = std::cos(pi * (k + 0.75) / (n + 0.5));
    double slope = 1;
    for (int iteration = 0; iteration < 100; ++iteration) {
      double p = 1, before = 0;
      for (int j = 0; j < n; ++j) {
        const double next = ((2 * j + 1) * x * p - j * before) / (j + 1);
        before = p;
        p = next;
      }
      slope = n * (x * p - before) / (x * x - 1);
      const double step = p / slope;
      x -= step;
      if (std::abs(step) < 1e-15) break;
    }
    rule.node.push_back(lower + 0.5 * (upper - lower) * (x + 1));
    rule.weight.push_back((upper - lower) / ((1 - x * x) * slope * slope));
  }
  return rule;
}

/// Maps x' = c x - (1 - c) G + G R cos(slope - phi): the map of the benchmark with its cosines put together;
/// c = cos^2(2 a), a = pi/8, R cos(phi) = (1 - c) cos a, R sin(phi) = (1 + c) sin a.
class RoughTerrain {
 public:
  explicit RoughTerrain(double sd_degrees) : sd_(sd_degrees * pi / 180) {}

  double fixed_point() const {
    return (amplitude * std::cos(mean_slope - phase) - (1 - kept_share) * twice_gravity) / (1 - kept_share);
  }
  /// Returns the density of the next state.
  double density(double from, double to) const {
    const double cosine = level(from, to);
    if (std::abs(cosine) >= 1) return 0;
    const double z = (phase - std::acos(cosine) - mean_slope) / sd_;
    return std::exp(-0.5 * z * z) / (sd_ * std::sqrt(2 * pi) * amplitude * std::sqrt(1 - cosine * cosine));
  }
  /// Returns the probability of x' <= 0, from the error function.
  double kill(double from) const {
    const double slope = phase - std::acos(level(from, 0));
    return 0.5 * std::erfc((mean_slope - slope) / (sd_ * std::numbers::sqrt2));
  }

 private:
  static constexpr double twice_gravity = 2 * 9.8, kept_share = 0.5;
  static inline const double half_angle = pi / 8, mean_slope = 8 * pi / 180;
  static inline const double amplitude =
      twice_gravity * std::hypot((1 - kept_share) * std::cos(half_angle), (1 + kept_share) * std::sin(half_angle));
  static inline const double phase =
      std::atan2((1 + kept_share) * std::sin(half_angle), (1 - kept_share) * std::cos(half_angle));

  /// Returns cos(slope - phi) of the slope that leads there.
  static double level(double from, double to) {
    return (to - kept_share * from + (1 - kept_share) * twice_gravity) / amplitude;
  }

  double sd_;
};

struct Answer {
  double failure_rate = 0;
  double from_fixed_point = 0;
};

/// Finds everything in double precision on `nodes` points of (0, upper].
Answer solve(double sd_degrees, int nodes) {
  const RoughTerrain wheel(sd_degrees);
  // It lies ten standard deviations above the fixed point: sd of x' is 0.17 per degree, of the stationary state 2 /
  // sqrt(3) of it.
  const double upper = wheel.fixed_point() + 10 * 0.21 * sd_degrees;
  const Rule rule = gauss_legendre(nodes, 0, upper);
  const std::size_t n = rule.node.size();
  std::vector<double> matrix(n * n), kill(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] = wheel.density(rule.node[i], rule.node[j]) * rule.weight[j];
    kill[i] = wheel.kill(rule.node[i]);
  }
  const ChainSolver solver(Chain::from_dense(n, matrix, kill));
  const std::vector<double> mean = mean_first_passage(solver);
  Answer answer{quasi_stationary(solver).failure_rate, 1};
  for (std::size_t j = 0; j < n; ++j) {
    answer.from_fixed_point += wheel.density(wheel.fixed_point(), rule.node[j]) * rule.weight[j] * mean[j];
  }
  return answer;
}

struct Reference {
  double sd_degrees;
  double failure_rate, from_quasi_stationary, from_fixed_point;
  friend void PrintTo(const Reference& reference, std::ostream* out) {
    *out << "sd " << reference.sd_degrees << " deg";
  }
};

class RoughTerrainTest : public ::testing::TestWithParam<Reference> {};

TEST_P(RoughTerrainTest, ReproducesTheSixtyDigitValues) {
  const Reference exact = GetParam();
  const Answer answer = solve(exact.sd_degrees, 100);
  EXPECT_NEAR(answer.failure_rate / exact.failure_rate, 1, 1e-13);
  EXPECT_NEAR(1 / answer.failure_rate / exact.from_quasi_stationary, 1, 1e-13);
  EXPECT_NEAR(answer.from_fixed_point / exact.from_fixed_point, 1, 1e-13);
}

INSTANTIATE_TEST_SUITE_P(
    Slopes, RoughTerrainTest,
    ::testing::Values(Reference{2.0, 2.3121853052586986e-4, 4324.9128766870834, 4326.1846791959863},
                      Reference{1.5, 1.5280057867965971e-6, 654447.78327473479, 654449.43992398285},
                      Reference{1.0, 1.1990367683962527e-12, 834002781530.65289, 834002781532.82850}),
    [](const auto& slope) {
      return "SdTenthsOfADegree" + std::to_string(static_cast<int>(10 * slope.param.sd_degrees));
    });

}  // namespace
}  // namespace metastable::markov
