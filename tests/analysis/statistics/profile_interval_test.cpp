#include "analysis/statistics/profile_interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace metastable::analysis {
namespace {

constexpr double half_quantile = 1.9207294103470619;  // of chi^2 with one degree of freedom at 0.95, halved

// Takes n normal values of mean 2 and sd 0.5 (maximum likelihood): minus ln likelihood in the mean and ln sd.
constexpr double n = 12;
double normal_sample(const std::vector<double>& x, std::vector<double>& gradient) {
  const double off = x[0] - 2, square = (0.25 + off * off) * std::exp(-2 * x[1]);
  gradient = {n * off * std::exp(-2 * x[1]), n * (1 - square)};
  return n * (x[1] + square / 2);
}
Minimum least() {
  std::vector<double> gradient;
  Minimum minimum;
  minimum.at = {2, std::log(0.5)};
  minimum.value = normal_sample(minimum.at, gradient);
  return minimum;
}
const Eigen::MatrixXd hessian{{n / 0.25, 0}, {0, 2 * n}};

TEST(ProfileInterval, OfANormalSamplesMeanAndSd) {
  // The mean's profile is n/2 ln(1 + (m - 2)^2 / 0.25), a closed form, wider than the curvature's 1.96 sd / sqrt(n).
  const auto both = profile_intervals(normal_sample, {{least(), hessian}}, {-10, -10}, {10, 10});
  const ProfileInterval &mean = both[0], &sd = both[1];
  const double half = 0.5 * std::sqrt(std::expm1(2 * half_quantile / n));
  EXPECT_TRUE(mean.bounded_below && mean.bounded_above);
  EXPECT_NEAR(mean.upper - 2, half, 0.01 * half);
  EXPECT_NEAR(2 - mean.lower, half, 0.01 * half);
  // The sd's is not symmetric: its ends solve n (u + exp(-2 u) / 2 - 1/2) = 1.92, u = ln(sd / 0.5).
  for (const double u : {sd.lower - std::log(0.5), sd.upper - std::log(0.5)})
    EXPECT_NEAR(n * (u + std::exp(-2 * u) / 2 - 0.5), half_quantile, 0.08);
  EXPECT_GT(sd.upper + sd.lower, 2 * std::log(0.5));
}

TEST(ProfileInterval, SaysWhereTheRangeEndsFirst) {
  const ProfileInterval mean = profile_intervals(normal_sample, {{least(), hessian}}, {1.9, -10}, {10, 10})[0];
  EXPECT_FALSE(mean.bounded_below);
  EXPECT_EQ(mean.lower, 1.9);
  EXPECT_TRUE(mean.bounded_above);
}

// On a ridge the sum is known to 0.01, the difference to 1 only.
TEST(ProfileInterval, FollowsARidge) {
  const auto ridge = [](const std::vector<double>& x, std::vector<double>& gradient) {
    const double sum = (x[0] + x[1]) / 0.01, difference = x[0] - x[1];
    gradient = {sum / 0.01 + difference, sum / 0.01 - difference};
    return 0.5 * (sum * sum + difference * difference);
  };
  const Eigen::MatrixXd curved{{1e4 + 1, 1e4 - 1}, {1e4 - 1, 1e4 + 1}};
  Minimum minimum;
  minimum.at = {0, 0};
  const double half = 1.959963984540054 * std::sqrt(1 + 1e-4) / 2;  // of x = (sum + difference) / 2
  for (const ProfileInterval& x : profile_intervals(ridge, {{minimum, curved}}, {-5, -5}, {5, 5})) {
    EXPECT_NEAR(x.upper, half, 0.01 * half);
    EXPECT_NEAR(x.lower, -half, 0.01 * half);
  }
}

// There are two wells, at -2 and, higher by 0.5, at 2; between them the cost is well above the level.
TEST(ProfileInterval, SpansAllModes) {
  const auto wells = [](const std::vector<double>& x, std::vector<double>& gradient) {
    const double well = x[0] * x[0] - 4;
    gradient = {4 * well * x[0] + 0.125, x[1]};
    return well * well + 0.125 * (x[0] + 2) + x[1] * x[1] / 2;
  };
  std::vector<Mode> modes(2);
  for (const std::size_t m : {0, 1}) {
    modes[m].minimum = quasi_newton(wells, {m == 0 ? -2.1 : 2.1, 0}, 1e-12, 100);
    modes[m].hessian = Eigen::MatrixXd{{32, 0}, {0, 1}};
  }
  const ProfileInterval one = profile_intervals(wells, {modes[0]}, {-5, -5}, {5, 5})[0];
  const ProfileInterval both = profile_intervals(wells, modes, {-5, -5}, {5, 5})[0];
  EXPECT_LT(one.upper, -1);
  EXPECT_EQ(both.lower, one.lower);
  // It ends on the far side of the second well, where it has risen by 1.92 over the first.
  EXPECT_NEAR(std::pow(both.upper * both.upper - 4, 2) + 0.125 * (both.upper + 2) - modes[0].minimum.value,
              half_quantile, 0.08);
}

TEST(ProfileInterval, HandsBackABetterMinimum) {
  Minimum wrong = least();
  wrong.at[0] = 2.4;
  std::vector<double> gradient;
  wrong.value = normal_sample(wrong.at, gradient);
  const ProfileInterval mean = profile_intervals(normal_sample, {{wrong, hessian}}, {-10, -10}, {10, 10})[0];
  ASSERT_TRUE(mean.better);
  EXPECT_LT(mean.better->value, wrong.value - 0.01);
}

}  // namespace
}  // namespace metastable::analysis
