#include "analysis/statistics/bounded_interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace metastable::analysis {
namespace {

// Integrates the density of estimates over those whose interval holds the mean.
TEST(BoundedInterval, HoldsEveryMeanInNineCasesOfTen) {
  constexpr double step = 0.002;
  std::vector<std::pair<double, std::pair<double, double>>> all;
  for (double x = -6; x < 10; x += step) all.emplace_back(x, bounded_interval(x));
  for (const double mean : {0.0, 0.1, 0.5, 1.0, 1.7, 3.0, 5.0}) {
    double held = 0;
    for (const auto& [x, interval] : all)
      if (interval.first <= mean && mean <= interval.second)
        held += step * std::exp(-0.5 * (x - mean) * (x - mean)) / std::sqrt(2 * std::acos(-1));
    EXPECT_NEAR(held, 0.9, 0.001) << mean;
  }
}

// Far from 0 it is the usual one; at and below 0 it ends where the table of its authors does.
TEST(BoundedInterval, IsTheUsualOneFarFromZero) {
  EXPECT_NEAR(bounded_interval(6).first, 6 - 1.6449, 1e-3);
  EXPECT_NEAR(bounded_interval(6).second, 6 + 1.6449, 1e-3);
  EXPECT_EQ(bounded_interval(0).first, 0);
  EXPECT_NEAR(bounded_interval(0).second, 1.64, 0.005);
  EXPECT_EQ(bounded_interval(1.28).first, 0);
  EXPECT_GT(bounded_interval(1.29).first, 0);
  EXPECT_NEAR(bounded_interval(-3).second, 0.26, 0.005);
  EXPECT_GT(bounded_interval(-1e6).second, 0);
}

}  // namespace
}  // namespace metastable::analysis
