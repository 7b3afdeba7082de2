#include "dynamics/numerics/truncated_normal.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/dynamics/normal_digits.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

using Wide = boost::multiprecision::cpp_bin_float_50;
constexpr double infinity = std::numeric_limits<double>::infinity();

Wide wide_cdf(const Wide& z) { return normal_tail_digits(Wide(-z)); }

struct Case {
  double mean, sd, lower, upper;
};
const Case cases[] = {{0.4, 0.1, 0, 1},  {0.4, 0.2, 0, infinity}, {7.35, 0.19, 0, infinity},   {0.4, 0.05, 0, 1},
                      {-0.5, 0.1, 0, 1}, {1.6, 0.1, 0, 1},        {0, 1, -infinity, infinity}, {0, 1, -infinity, -2}};

// The score is exact when the mixture of the tails of both bounds is met; a Newton step in 50 digits solves it here.
TEST(TruncatedNormal, AtScoreAgreesWithFiftyDigits) {
  for (const Case& c : cases) {
    const TruncatedNormal normal(c.mean, c.sd, c.lower, c.upper);
    const auto tail_at = [&](double bound, int sign) {
      if (std::isinf(bound)) return Wide(sign * bound > 0 ? 1 : 0);
      return wide_cdf(sign * (Wide(bound) - c.mean) / c.sd);
    };
    for (double score : {-37.0, -20.0, -8.0, -3.0, -1.0, 0.0, 0.5, 2.0, 5.0, 12.0, 25.0, 37.0}) {
      const Wide p = wide_cdf(score), q = wide_cdf(-Wide(score));
      const Wide below = q * tail_at(c.lower, 1) + p * tail_at(c.upper, 1);
      const Wide above = q * tail_at(c.lower, -1) + p * tail_at(c.upper, -1);
      const double x = normal.at_score(score);
      const Wide z = (Wide(x) - c.mean) / c.sd;
      // This is Newton on the logarithm of the smaller tail.
      const bool lower_tail = below < above;
      const Wide tail = lower_tail ? wide_cdf(z) : wide_cdf(-z), wanted = lower_tail ? below : above;
      const Wide error = abs((tail - wanted) / normal_density_digits(z)) * c.sd;
      EXPECT_LT(error, 4e-16 * std::max({std::abs(x), std::abs(c.mean), c.sd}) * std::max(1.0, std::abs(score)))
          << "N(" << c.mean << ", " << c.sd << "^2) at " << score;
    }
  }
}

// Draws that round to the bound itself once made failures of 1e-17 a step 2 % too frequent: eta = 0 lasts for ever.
TEST(TruncatedNormal, AtScoreKeepsTheDistanceFromABound) {
  for (const Case& c : {Case{0.4, 0.1, 0, 1}, {0.4, 0.2, 0, infinity}, {-0.5, 0.1, 0, 1}}) {
    const TruncatedNormal normal(c.mean, c.sd, c.lower, c.upper);
    double before = 0;
    for (double score = -37; score < -2; score += 0.01) {
      const double x = normal.at_score(score);
      EXPECT_GT(x, before);
      EXPECT_NEAR(normal.cdf(x) / normal_cdf(score), 1, 1e-10) << score;
      before = x;
    }
  }
}

TEST(TruncatedNormal, TailsAgreeWithFiftyDigits) {
  for (const Case& c : cases) {
    const TruncatedNormal normal(c.mean, c.sd, c.lower, c.upper);
    const auto at = [&](double x) { return std::isinf(x) ? Wide(x > 0 ? 1 : 0) : wide_cdf((Wide(x) - c.mean) / c.sd); };
    const Wide mass = at(c.upper) - at(c.lower);
    for (double score : {-30.0, -10.0, -4.0, -0.3, 0.0, 1.7, 6.0, 30.0}) {
      const double x = c.mean + c.sd * score;
      if (x <= c.lower || x >= c.upper) continue;
      const Wide below = (at(x) - at(c.lower)) / mass, above = (at(c.upper) - at(x)) / mass;
      // 50 digits hold differences of tails down to about 1e-35 of 1; skip what the reference cannot tell.
      if (below > Wide(1e-30)) {
        EXPECT_NEAR(static_cast<double>(normal.cdf(x) / below), 1, 1e-12);
      }
      if (above > Wide(1e-30)) {
        EXPECT_NEAR(static_cast<double>(normal.complement(x) / above), 1, 1e-12);
      }
    }
  }
}

TEST(TruncatedNormal, KeepsRelativeAccuracyNextToABound) {
  const TruncatedNormal normal(0.4, 0.1, 0, 1);
  const double slope = normal.density(0);
  EXPECT_NEAR(normal.cdf(1e-30) / (1e-30 * slope), 1, 1e-12);
  EXPECT_NEAR(normal.cdf(1e-200) / (1e-200 * slope), 1, 1e-12);
}

RC_GTEST_PROP(TruncatedNormal, ScoresRiseAndInvertTheDistribution, ()) {
  const TruncatedNormal normal(uniform(0.1, 0.9), uniform(0.02, 0.5), 0, 1);
  const double first = uniform(-8, 8), second = uniform(-8, 8);
  RC_ASSERT((first <= second) == (normal.at_score(first) <= normal.at_score(second)) ||
            normal.at_score(first) == normal.at_score(second));
  const double score = uniform(-5, 5), x = normal.at_score(score);
  RC_ASSERT(std::abs(normal.cdf(x) / normal_cdf(score) - 1) < 1e-8);
  RC_ASSERT(std::abs(normal.cdf(x) + normal.complement(x) - 1) < 1e-14);
}

TEST(TruncatedNormal, MomentsAreThoseOfTheClosedForm) {
  // These are mean and variance by the textbook formulas with phi, Phi.
  const double mean = 0.4, sd = 0.2, a = -2, b = 3;
  const double mass = normal_cdf(b) - normal_cdf(a);
  const double shift = (normal_density(a) - normal_density(b)) / mass;
  const double variance = 1 + (a * normal_density(a) - b * normal_density(b)) / mass - shift * shift;
  const TruncatedNormal normal(mean, sd, 0, 1);
  EXPECT_NEAR(normal.truncated_mean(), mean + sd * shift, 1e-13);
  EXPECT_NEAR(normal.truncated_sd(), sd * std::sqrt(variance), 1e-13);
}

TEST(TruncatedNormal, ZeroSpreadIsAConstant) {
  const TruncatedNormal constant(0.4, 0, 0, 1);
  EXPECT_TRUE(constant.constant());
  EXPECT_EQ(constant.at_score(-30), 0.4);
  EXPECT_EQ(constant.cdf(0.4), 1);
  EXPECT_EQ(constant.cdf(0.39), 0);
  EXPECT_EQ(constant.complement(0.4), 0);
  EXPECT_EQ(constant.truncated_mean(), 0.4);
  EXPECT_EQ(constant.truncated_sd(), 0);
  EXPECT_THROW(constant.density(0.4), std::logic_error);
}

TEST(TruncatedNormal, IllegalInputIsNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(message_of([] { TruncatedNormal(0, -1); }), "sd: -1 is outside [0, inf)");
  EXPECT_EQ(message_of([&] { TruncatedNormal(nan, 1); }), "mean: nan is not a finite number");
  EXPECT_EQ(message_of([] { TruncatedNormal(0, 1, 2, 1); }), "bounds: [2, 1] is not an interval");
  EXPECT_EQ(message_of([] { TruncatedNormal(2, 0, 0, 1); }), "mean: the constant 2 is outside [0, 1]");
  EXPECT_EQ(message_of([] { TruncatedNormal(100, 0.1, 0, 1); }),
            "empty truncation: N(100, 0.1^2) has less than 1e-290 of its mass in [0, 1]");
  EXPECT_THROW(normal_quantile(0), std::domain_error);
}

}  // namespace
}  // namespace metastable::dynamics::test
