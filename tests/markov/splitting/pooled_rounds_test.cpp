// Tests what rounds of splitting say together against closed forms, and intervals of survival against a finite chain.

#include "markov/splitting/pooled_rounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "markov/splitting/splitting_study.h"
#include "tests/markov/splitting/ladder.h"

namespace metastable::markov::testing {
namespace {

TEST(PooledRounds, OfTheSameSharesSayWhatThoseSay) {
  const RoundShares round{.early = {0, 0.5}, .late = {0.1}};
  const PooledRounds pool({round, round, round});
  const MeshEstimate steps = pool.steps(), rate = pool.failure_rate();
  EXPECT_NEAR(steps.value, 1 + 1 + 0.5 / 0.1, 1e-12);
  EXPECT_NEAR(steps.upper / steps.lower, 1, 1e-12);
  EXPECT_NEAR(rate.value, 0.1, 1e-12);
  EXPECT_NEAR(pool.survival_after(2).value, 0.5, 1e-12);
  EXPECT_NEAR(pool.survival_after(12).value, 0.5 * std::pow(0.9, 10), 1e-12);
  EXPECT_NEAR(pool.survival_after(12).upper, 0.5 * std::pow(0.9, 10), 1e-12);
}

TEST(PooledRounds, GoRoundThePhases) {
  const PooledRounds pool(std::vector<RoundShares>(2, {.early = {0, 0}, .late = {0.2, 0}}));
  EXPECT_NEAR(pool.survival_after(7).value, 0.8 * 0.8 * 0.8, 1e-12);
  EXPECT_NEAR(pool.survival_after(8).value, 0.8 * 0.8 * 0.8, 1e-12);
  EXPECT_NEAR(pool.steps().value, 2 + 1.8 / 0.2, 1e-12);
  EXPECT_NEAR(pool.failure_rate().value, 1 - std::sqrt(0.8), 1e-12);
}

TEST(PooledRounds, SurvivalIsNotToldWhereNoRoundSawAFailureOrFewDid) {
  const RoundShares none{.early = {0, 0, 0}, .late = {1e-6}}, one{.early = {0, 1e-6, 0}, .late = {1e-6}};
  const PooledRounds pool({one, none, none, none, none, none, none, none});
  EXPECT_EQ(pool.survival_after(1).value, 1);
  EXPECT_TRUE(std::isnan(pool.survival_after(1).lower));
  EXPECT_NEAR(1 - pool.survival_after(2).value, 1e-6 / 8, 1e-12);
  EXPECT_TRUE(std::isnan(pool.survival_after(2).lower));
  EXPECT_FALSE(std::isnan(pool.survival_after(3000).lower));  // the late failures are as many in all
}

TEST(PooledRounds, WhereAllHaveFailedNothingIsBeyond) {
  const PooledRounds pool(std::vector<RoundShares>(4, {.early = {0.5, 0.75}, .late = {}}));
  EXPECT_NEAR(pool.steps().value, 1.5, 1e-12);
  EXPECT_TRUE(std::isnan(pool.failure_rate().value));
  EXPECT_NEAR(pool.survival_after(2).value, 0.125, 1e-12);
  EXPECT_TRUE(std::isnan(pool.survival_after(3).value));
}

// The jackknife of a mean is the mean's standard error: of eight shares, four of 0.4 and four of 0.6, 0.0378.
TEST(OddsInterval, IsStudentsOfTheMean) {
  const std::vector<double> over{0.4, 0.6, 0.4, 0.6, 0.4, 0.6, 0.4, 0.6}, under(8, 1.0);
  const RatioOfSums ratio = ratio_of_sums(over, under);
  EXPECT_NEAR(ratio.value, 0.5, 1e-12);
  EXPECT_NEAR(standard_error(ratio), 0.1 / std::sqrt(7.0), 1e-12);
  const MeshEstimate found = odds_interval(ratio.value, ratio.without);
  EXPECT_NEAR(found.upper + found.lower, 1, 1e-3);  // log odds are odd around a half
  EXPECT_NEAR(0.5 * (found.upper - found.lower), 2.37 * 0.1 / std::sqrt(7.0), 0.003);
  EXPECT_NEAR(odds_interval(ratio.value, ratio.without, 2).upper, 0.675, 0.003);
}

TEST(SplittingStudy, IntervalsOfSurvivalHoldThoseOfAFiniteChain) {
  const Ladder ladder{.top = 6, .up = 0.15};  // 2.5e5 steps
  const std::vector<double> exact = ladder.survival(1000);
  constexpr int seeds = 12;
  for (const auto& [what, map] : {std::pair("scores", ladder.batch()), std::pair("draws", ladder.drawing())}) {
    std::vector<std::uint64_t> steps{8, 12, 20, 300, 1000};
    std::vector<int> held(steps.size(), 0), told(steps.size(), 0);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      const SplittingStudy study =
          splitting_study(map, std::vector{0.0},
                          {.replicas = 200, .rounds = 16, .pilots = 2, .tolerance = 0.2, .seed = seed, .threads = 1});
      ASSERT_EQ(study.disagreement, "");
      EXPECT_TRUE(std::isnan(study.survival[4].lower)) << "nothing fails in five steps";
      for (std::size_t k = 0; k < steps.size(); ++k) {
        const MeshEstimate share = survival_after(study, steps[k]);
        if (std::isnan(share.lower)) continue;
        ++told[k];
        held[k] += share.lower <= exact[steps[k]] && exact[steps[k]] <= share.upper;
        EXPECT_LT((1 - share.lower) / (1 - share.upper), widest_interval + 1e-9);
      }
      EXPECT_EQ(study.survival[7].lower, survival_after(study, 8).lower);
    }
    for (std::size_t k = 0; k < steps.size(); ++k) {
      EXPECT_GE(told[k], seeds - 3) << what << ", after " << steps[k];
      EXPECT_GE(held[k], told[k] - 3) << what << ", after " << steps[k];
    }
  }
}

}  // namespace
}  // namespace metastable::markov::testing
