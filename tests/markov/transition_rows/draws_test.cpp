#include "markov/transition_rows/draws.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

namespace metastable::markov {
namespace {

double tail_estimate(const Draws& draws, double threshold) {
  double sum = 0;
  for (std::size_t k = 0; k < draws.count(); ++k)
    if (draws.score[k * static_cast<std::size_t>(draws.dimension)] > threshold) sum += draws.weight[k];
  return sum;
}

double moment(const Draws& draws, int dimension, int power) {
  double sum = 0;
  for (std::size_t k = 0; k < draws.count(); ++k)
    sum += draws.weight[k] *
           std::pow(draws.score[k * static_cast<std::size_t>(draws.dimension) + static_cast<std::size_t>(dimension)],
                    power);
  return sum;
}

TEST(Draws, WeightedDrawsSeeTailsPlainOnesMiss) {
  const Draws weighted = make_draws(2, {.count = 16384});
  for (const double z : {2.0, 5.0, 7.034483825301131 /* 1e-12 */, 10.0}) {
    const double exact = 0.5 * std::erfc(z / std::sqrt(2.0));
    EXPECT_NEAR(tail_estimate(weighted, z) / exact, 1.0, 0.03) << z;
  }
  const Draws plain = make_draws(2, {.count = 16384, .weighting = Weighting::plain});
  EXPECT_EQ(tail_estimate(plain, 7.034483825301131), 0.0);
  EXPECT_NEAR(tail_estimate(plain, 2.0) / 0.022750131948179195, 1.0, 0.01);
}

TEST(Draws, MomentsAreThoseOfIndependentStandardNormals) {
  for (const Weighting weighting : {Weighting::weighted, Weighting::plain}) {
    const Draws draws = make_draws(2, {.count = 65536, .weighting = weighting});
    EXPECT_NEAR(std::accumulate(draws.weight.begin(), draws.weight.end(), 0.0), 1.0, 1e-12);
    for (int d = 0; d < 2; ++d) {
      EXPECT_NEAR(moment(draws, d, 1), 0.0, 2e-3);
      EXPECT_NEAR(moment(draws, d, 2), 1.0, 2e-3);
      EXPECT_NEAR(moment(draws, d, 4), 3.0, 2e-2);
    }
    double cross = 0, offset = 0;
    for (std::size_t k = 0; k < draws.count(); ++k) {
      cross += draws.weight[k] * draws.score[2 * k] * draws.score[2 * k + 1];
      offset += draws.weight[k] * draws.offset[k];
    }
    EXPECT_NEAR(cross, 0.0, 2e-3);
    EXPECT_NEAR(offset, 0.5, 1e-3);
  }
}

TEST(Draws, SobolConvergesFasterThanRandom) {
  // Returns the root mean square error of E z^2 over 16 randomisations, at two sizes.
  const auto error = [](Sequence sequence, std::size_t count) {
    double square = 0;
    for (std::uint32_t r = 0; r < 16; ++r) {
      const Draws draws = make_draws(2, {.count = count, .replicate = r, .sequence = sequence});
      square += std::pow(moment(draws, 0, 2) - 1.0, 2);
    }
    return std::sqrt(square / 16);
  };
  EXPECT_GT(error(Sequence::sobol, 256) / error(Sequence::sobol, 16384), 20);    // order near 1: 64
  EXPECT_LT(error(Sequence::random, 256) / error(Sequence::random, 16384), 20);  // order 1/2: 8
}

TEST(Draws, SeedAndReplicateFixTheBits) {
  for (const Sequence sequence : {Sequence::sobol, Sequence::random}) {
    const DrawOptions options{.count = 64, .seed = 7, .replicate = 3, .sequence = sequence};
    const Draws a = make_draws(2, options), b = make_draws(2, options);
    EXPECT_EQ(a.score, b.score);
    EXPECT_EQ(a.weight, b.weight);
    DrawOptions other = options;
    other.replicate = 4;
    EXPECT_NE(make_draws(2, other).score, a.score);
    other = options;
    other.seed = 8;
    EXPECT_NE(make_draws(2, other).score, a.score);
    // Draw number k does not depend on how many are asked for.
    other = options;
    other.count = 32;
    const Draws fewer = make_draws(2, other);
    for (std::size_t k = 0; k < fewer.score.size(); ++k) EXPECT_EQ(fewer.score[k], a.score[k]);
  }
}

TEST(Draws, NormalScoreIsExactInBothTails) {
  EXPECT_NEAR(normal_score(1e-12), -7.034483825301131, 1e-9);
  EXPECT_EQ(normal_score(0.5), 0.0);
  EXPECT_EQ(normal_score(0.25), -normal_score(0.75));
}

TEST(Draws, RefusesWhatItCannotDo) {
  EXPECT_THROW(make_draws(1, {.count = 8}), std::invalid_argument);
  EXPECT_THROW(make_draws(1, {.tail = 0.0}), std::invalid_argument);
  EXPECT_THROW(make_draws(1, {.tail = 0.1}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
