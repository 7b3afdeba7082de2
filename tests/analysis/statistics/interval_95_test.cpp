#include "analysis/statistics/interval_95.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace metastable::analysis {
namespace {

TEST(Interval95, NormalQuantile) { EXPECT_NEAR(0.5 * std::erfc(normal_95 / std::sqrt(2.0)), 0.025, 1e-15); }

// At the ends of the interval the tails of the binomial hold 2.5 % each.
TEST(Interval95, ExactShareLeavesOneFortiethInEachTail) {
  const Estimate share = exact_share(3, 10);
  EXPECT_DOUBLE_EQ(share.value, 0.3);
  const auto tail = [](int from, int to, double p) {
    double sum = 0;
    for (int k = from; k <= to; ++k)
      sum +=
          std::tgamma(11.0) / std::tgamma(k + 1.0) / std::tgamma(11.0 - k) * std::pow(p, k) * std::pow(1 - p, 10 - k);
    return sum;
  };
  EXPECT_NEAR(tail(3, 10, share.lower), 0.025, 1e-12);
  EXPECT_NEAR(tail(0, 3, share.upper), 0.025, 1e-12);
}

TEST(Interval95, NoneAndAllAreBoundedOnOneSide) {
  const Estimate none = exact_share(0, 20), all = exact_share(20, 20);
  EXPECT_EQ(none.lower, 0);
  EXPECT_NEAR(none.upper, 1 - std::pow(0.025, 1 / 20.0), 1e-14);
  EXPECT_EQ(all.upper, 1);
  EXPECT_NEAR(all.lower, std::pow(0.025, 1 / 20.0), 1e-14);
}

TEST(Interval95, WhatIsNoShareIsRefused) {
  EXPECT_THROW(exact_share(0, 0), std::invalid_argument);
  EXPECT_THROW(exact_share(3, 2), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
