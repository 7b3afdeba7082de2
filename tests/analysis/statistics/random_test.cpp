#include "analysis/statistics/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

TEST(Random, UnitIntervalStaysInsideAndIsSymmetric) {
  EXPECT_EQ(unit_interval(0), 0x1p-53);
  EXPECT_EQ(1 - unit_interval(~std::uint64_t{0}), 0x1p-53);
  EXPECT_EQ(unit_interval(std::uint64_t{1} << 63), 0.5 + 0x1p-53);
}

TEST(Random, MultipliersAreStandardNormalAndEachStreamsOwn) {
  const std::vector<double> many = normal_multipliers(3, 7, DrawStream::chance_on_map, 4001);
  EXPECT_NEAR(std::accumulate(many.begin(), many.end(), 0.0) / 4001, 0, 4 / std::sqrt(4001.0));
  EXPECT_NEAR(std::inner_product(many.begin(), many.end(), many.begin(), 0.0) / 4001, 1, 4 * std::sqrt(2 / 4001.0));
  const std::vector<double> first(many.begin(), many.begin() + 10);
  EXPECT_EQ(normal_multipliers(3, 7, DrawStream::chance_on_map, 10), first);
  for (const auto& other : {normal_multipliers(3, 7, DrawStream::chance_of_effects, 10),
                            normal_multipliers(3, 8, DrawStream::chance_on_map, 10),
                            normal_multipliers(4, 7, DrawStream::chance_on_map, 10)})
    EXPECT_NE(other, first);
  EXPECT_EQ(normal_multipliers(3, 7, DrawStream::chance_on_map, 0).size(), 0u);
}

TEST(Random, EvenNormalsAreOneFromEachCellAndWithoutOrder) {
  constexpr std::size_t count = 400;
  const std::vector<double> even = even_normals(3, 7, count);
  std::vector<double> sorted = even;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(std::floor(count * dynamics::normal_cdf(sorted[i])), i);
  double successive = 0;
  for (std::size_t i = 1; i < count; ++i) successive += even[i - 1] * even[i] / count;
  EXPECT_NEAR(successive, 0, 4 / std::sqrt(double{count}));
  EXPECT_EQ(even_normals(3, 7, count), even);
  EXPECT_NE(even_normals(3, 8, count), even);
  EXPECT_NE(even_normals(4, 7, count), even);
  EXPECT_TRUE(even_normals(3, 7, 0).empty());
}

TEST(Random, ExponentialWeightsHaveMeanAndVarianceOne) {
  double sum = 0, squares = 0;
  for (std::uint64_t trial = 0; trial < 4000; ++trial) {
    const double weight = exponential_weight(5, 2, trial);
    EXPECT_GT(weight, 0);
    sum += weight / 4000;
    squares += weight * weight / 4000;
  }
  EXPECT_NEAR(sum, 1, 4 / std::sqrt(4000.0));
  EXPECT_NEAR(squares, 2, 4 * std::sqrt(20 / 4000.0));
}

}  // namespace
}  // namespace metastable::analysis
