#include "analysis/statistics/trial_design.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {
namespace {

// The lesser of 17 and a geometric lifetime T.
std::vector<double> geometric(double failure) {
  std::vector<double> probability{0};
  double left = 1;
  for (int n = 1; n <= 16; ++n) probability.push_back(left * failure), left *= 1 - failure;
  probability.push_back(left);
  return probability;
}

// Tests pairs of samples one by one, by another generator and the test that describe applies.
double tested_power(const std::vector<double>& a, const std::vector<double>& b, std::size_t trials) {
  std::mt19937_64 engine(7);
  std::discrete_distribution<int> of_a(a.begin(), a.end()), of_b(b.begin(), b.end());
  constexpr int pairs = 1500;
  int apart = 0;
  std::vector<double> x(trials), y(trials);
  for (int k = 0; k < pairs; ++k) {
    for (double& one : x) one = of_a(engine);
    for (double& one : y) one = of_b(engine);
    apart += welch_t_test(x, y).p < 0.05;
  }
  return static_cast<double>(apart) / pairs;
}

TEST(TrialDesign, HasThePowerItSays) {
  constexpr double error = 4 * 0.0107;  // four standard errors of both
  std::size_t small = 0;
  for (const double rate : {0.9, 0.5, 0.2})
    for (const double times : {0.02, 0.1, 0.4}) {
      const std::vector<double> a = geometric(rate), b = geometric(rate * times);
      const auto design = trials_for_power(a, b);
      ASSERT_TRUE(design);
      if (design->trials > 40) continue;
      const auto trials = static_cast<std::size_t>(design->trials);
      EXPECT_NEAR(tested_power(a, b, trials), design->power, error) << rate << ' ' << times << ' ' << trials;
      EXPECT_GE(design->power, 0.8);
      if (trials > 2) {
        EXPECT_LT(tested_power(a, b, trials - 1), 0.8 + error) << rate << ' ' << times;
      }
      small += trials <= 20;
    }
  EXPECT_GE(small, 5u);
}

TEST(TrialDesign, ConstantsNeedTwo) {
  const auto design = trials_for_power({0, 0, 1}, {0, 0, 0, 1});
  ASSERT_TRUE(design);
  EXPECT_EQ(design->trials, 2);
  EXPECT_EQ(design->power, 1);
  EXPECT_FALSE(trials_for_power({0, 1}, {0, 1}));
  EXPECT_THROW(trials_for_power({}, {1}), std::invalid_argument);
}

// Of many trials the means are normal: n = (1.96 + 0.84)^2 (var_a + var_b) / (mean_a - mean_b)^2.
TEST(TrialDesign, ManyTrialsAreNormal) {
  const double p = 0.5, q = 0.52;
  const double reach = 1.959963984540054 + 0.8416212335729143;
  EXPECT_EQ(trials_for_power({1 - p, p}, {1 - q, q})->trials,
            std::ceil(reach * reach * (p * (1 - p) + q * (1 - q)) / ((p - q) * (p - q))));
}

}  // namespace
}  // namespace metastable::analysis
