// Tests medians with intervals from rounds on draws whose quantiles are known.

#include "analysis/walkers/round_quantiles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "markov/transition_rows/score_lattice.h"

namespace metastable::analysis {
namespace {

struct Drawn {
  std::vector<double> values, weights;
  std::vector<std::size_t> ends;
};

/// Draws exponentials, ten clones of each, in rounds of uneven weight and size.
Drawn exponentials(std::uint64_t seed, std::size_t rounds, std::size_t lines) {
  Drawn drawn;
  for (std::size_t r = 0; r < rounds; ++r) {
    const double heavy = 0.5 + markov::uniforms(seed, 1, r, 0)[0];
    const std::size_t own = lines + r % 4;
    for (std::size_t i = 0; i < own; ++i) {
      const double value = -std::log(markov::uniforms(seed, 2, r, i)[0]);
      for (int clone = 0; clone < 10; ++clone) drawn.values.push_back(value), drawn.weights.push_back(heavy);
    }
    drawn.ends.push_back(drawn.values.size());
  }
  return drawn;
}

TEST(RoundQuantiles, IntervalsHoldTheQuantilesOfADistribution) {
  constexpr int seeds = 400;
  std::vector<int> held(3, 0), told(3, 0);
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Drawn drawn = exponentials(seed, 16, 40);
    const SpreadIntervals found = round_quantiles(drawn.values, drawn.weights, drawn.ends);
    const Estimate middle = middle_90(drawn.values, drawn.weights);
    EXPECT_EQ(found.median.value, middle.value);
    EXPECT_EQ(found.low.value, middle.lower);
    EXPECT_EQ(found.high.value, middle.upper);
    const auto count = [&](std::size_t which, const Estimate& one, double level) {
      if (!std::isfinite(one.lower)) return;
      ++told[which];
      held[which] += one.lower <= -std::log(1 - level) && -std::log(1 - level) <= one.upper;
    };
    count(0, found.median, 0.5), count(1, found.low, 0.05), count(2, found.high, 0.95);
  }
  EXPECT_EQ(told[0], seeds);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_GE(told[k], 0.95 * seeds) << k;
    EXPECT_GE(held[k], 0.9 * told[k]) << k;
    EXPECT_LE(held[k], 0.99 * told[k]) << k;
  }
}

TEST(RoundQuantiles, AreNotKnownWhereRoundsContradictEachOther) {
  Drawn drawn;
  for (int r = 0; r < 8; ++r) {
    for (int i = 0; i < 50; ++i) drawn.values.push_back(r < 4 ? i : 100 + i), drawn.weights.push_back(1);
    drawn.ends.push_back(drawn.values.size());
  }
  const SpreadIntervals found = round_quantiles(drawn.values, drawn.weights, drawn.ends);
  EXPECT_FALSE(std::isfinite(found.median.lower));
  EXPECT_FALSE(std::isfinite(found.high.lower));
}

TEST(RoundQuantiles, OfOneValueAreThatValue) {
  const std::vector<double> values(40, 7.0), weights(40, 1.0);
  const std::vector<std::size_t> ends{10, 20, 30, 40};
  const SpreadIntervals found = round_quantiles(values, weights, ends);
  EXPECT_EQ(found.median.lower, 7);
  EXPECT_EQ(found.median.upper, 7);
}

TEST(RoundShare, IsTheShareOfTheWeight) {
  const std::vector<double> inside{1, 0, 1, 0}, weights{1, 3, 1, 3};
  const std::vector<std::size_t> ends{2, 4};
  const Estimate share = round_share(inside, weights, ends);
  EXPECT_NEAR(share.value, 0.25, 1e-12);
  EXPECT_NEAR(share.lower, 0.25, 1e-12);
}

}  // namespace
}  // namespace metastable::analysis
