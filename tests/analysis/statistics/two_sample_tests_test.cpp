#include "analysis/statistics/two_sample_tests.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace metastable::analysis {
namespace {

// Cushny and Peebles (Student 1908) gave these sleep data; the results are those of R's t.test(extra ~ group, data =
// sleep).
const std::vector<double> group_1 = {0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0};
const std::vector<double> group_2 = {1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4};

TEST(TwoSampleTests, TTestsGiveStudentsSleep) {
  const TTest welch = welch_t_test(group_1, group_2);
  EXPECT_NEAR(welch.t, -1.8608, 5e-5);
  EXPECT_NEAR(welch.degrees_of_freedom, 17.776, 5e-4);
  EXPECT_NEAR(welch.p, 0.07939, 5e-6);
  EXPECT_NEAR(welch.difference.lower, -3.3654832, 1e-7);
  EXPECT_NEAR(welch.difference.upper, 0.2054832, 1e-7);
  const TTest pooled = pooled_t_test(group_1, group_2);
  EXPECT_NEAR(pooled.t, -1.8608, 5e-5);
  EXPECT_EQ(pooled.degrees_of_freedom, 18);
  EXPECT_NEAR(pooled.p, 0.07919, 5e-6);
}

TEST(TwoSampleTests, HedgesGHasTheNoncentralInterval) {
  const EffectSize g = hedges_g(group_1, group_2);
  const double d = -1.8608134674868526 * std::sqrt(0.2);
  EXPECT_NEAR(g.value, d * (1 - 3.0 / 71), 1e-9);
  // The interval excludes zero exactly where the pooled test does.
  EXPECT_LT(g.lower, g.value);
  EXPECT_GT(g.upper, 0);
  std::vector<double> shifted = group_2;
  for (double& x : shifted) x += 0.21;
  const double p = pooled_t_test(group_1, shifted).p;
  EXPECT_EQ(hedges_g(group_1, shifted).upper < 0, p < 0.05);
  EXPECT_LT(p, 0.06);
}

TEST(TwoSampleTests, ConstantSamplesHaveAnAnswer) {
  const std::vector<double> a(5, 2.0), b(7, 2.0), c(3, 1.0);
  EXPECT_EQ(welch_t_test(a, b).p, 1);
  EXPECT_EQ(welch_t_test(a, c).p, 0);
  EXPECT_EQ(kolmogorov_smirnov_test(a, b).p, 1);
  EXPECT_THROW(welch_t_test(a, std::vector<double>{1.0}), std::invalid_argument);
}

// Goes through all ways to split the ranks 1..n+m.
template <typename Use>
void each_split(int n, int m, const Use& use) {
  std::vector<int> chosen(static_cast<std::size_t>(n + m), 0);
  std::fill(chosen.begin(), chosen.begin() + n, 1);
  do {
    std::vector<double> a, b;
    for (int i = 0; i < n + m; ++i) (chosen[static_cast<std::size_t>(i)] ? a : b).push_back(i);
    use(a, b);
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
}

TEST(TwoSampleTests, KolmogorovSmirnovIsExactByEnumeration) {
  const std::vector<double> a = {1, 2, 3.5, 7, 8}, b = {3, 4, 5, 6, 9, 10, 11};
  const DistributionTest test = kolmogorov_smirnov_test(a, b);
  double count = 0, extreme = 0;
  each_split(5, 7, [&](const auto& x, const auto& y) {
    ++count;
    extreme += kolmogorov_smirnov_test(x, y).statistic >= test.statistic - 1e-12;
  });
  EXPECT_EQ(count, 792);
  EXPECT_NEAR(test.p, extreme / count, 1e-12);
  EXPECT_NEAR(test.statistic, 3.0 / 5 - 1.0 / 7, 1e-12);
}

TEST(TwoSampleTests, KolmogorovsLimitFollowsTheExactCount) {
  std::vector<double> a, b;
  for (int i = 0; i < 2100; ++i) a.push_back(i);
  for (int i = 0; i < 1900; ++i) b.push_back(1.17 * i + 0.5);
  const double exact = kolmogorov_smirnov_test(a, b).p;  // n m = 3.99e6
  for (int i = 0; i < 20; ++i) b.push_back(1.17 * i + 0.25), a.push_back(i + 0.25);
  const double limit = kolmogorov_smirnov_test(a, b).p;
  EXPECT_GT(exact, 1e-4);
  EXPECT_NEAR(limit / exact, 1, 0.35);  // 20 values moved, and the limit's own error
}

// By Scholz and Stephens, over all splits of distinct values the mean of A^2 is 1 and its variance their (4).
TEST(TwoSampleTests, AndersonDarlingHasItsMeanAndIsCalibrated) {
  double count = 0, sum = 0, rejected = 0, five = 0;
  each_split(6, 7, [&](const auto& x, const auto& y) {
    ++count;
    const DistributionTest test = anderson_darling_test(x, y);
    sum += test.statistic;
    rejected += test.p < 0.05;
    five += test.p < 0.25;
  });
  EXPECT_NEAR(sum / count, 1, 1e-12);
  EXPECT_NEAR(rejected / count, 0.05, 0.012);
  EXPECT_NEAR(five / count, 0.25, 0.02);
}

// The percentage points come from numerical inversion (Imhof) of sum chi^2_1 / (j (j + 1)), j = 1, 2, ...
TEST(TwoSampleTests, AndersonDarlingsLimit) {
  EXPECT_NEAR(anderson_darling_tail(1.933), 0.0999943, 2e-5);
  EXPECT_NEAR(anderson_darling_tail(2.492), 0.0500225, 2e-5);
  EXPECT_NEAR(anderson_darling_tail(3.878), 0.0100015, 2e-5);
  EXPECT_NEAR(anderson_darling_tail(8.0), 1.137e-4, 3e-6);
  EXPECT_NEAR(anderson_darling_tail(8.0001) / anderson_darling_tail(7.9999), 1, 0.03);  // where the forms meet
}

TEST(TwoSampleTests, SuperiorityIsTheMannWhitneyShare) {
  const std::vector<double> a = {1, 2, 3, 4}, b = {0, 2, 2.5};
  EXPECT_NEAR(superiority(a, b).value, (1 + 1.5 + 3 + 3) / 12.0, 1e-12);
  EXPECT_NEAR(superiority(b, a).value, 1 - superiority(a, b).value, 1e-12);
  const EffectSize all = superiority(std::vector<double>{5, 6, 7}, b);
  EXPECT_EQ(all.value, 1);
  EXPECT_NEAR(all.lower, std::pow(0.025, 1.0 / 3), 1e-12);
  // Sums of 1/754 are not 1: samples that lie apart are told by whole counts.
  const EffectSize apart = superiority(std::vector<double>(808, 2), std::vector<double>(754, 1));
  EXPECT_EQ(apart.value, 1);
  EXPECT_NEAR(apart.lower, std::pow(0.025, 1.0 / 754), 1e-12);
}

}  // namespace
}  // namespace metastable::analysis
