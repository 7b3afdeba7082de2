#include "markov/mesh/failure_count.h"

#include <gtest/gtest.h>

#include <cmath>

namespace metastable::markov {
namespace {

TEST(ForetoldHazard, IsTheSurvivalsAndThenGeometric) {
  const ForetoldHazard hazard{{0.9, 0.7}, 0.1};
  EXPECT_DOUBLE_EQ(hazard.at(0), 0);
  EXPECT_DOUBLE_EQ(hazard.at(1), -std::log(0.9));
  EXPECT_NEAR(hazard.at(4), -std::log(0.7 * 0.9 * 0.9), 1e-15);
}

TEST(FailureCount, RefutesAtItsLevel) {
  // Of 500 walks with a chance of 0.01 each: P(X >= 14) = 7.4e-4, P(X >= 15) = 2.3e-4; P(X = 0) = 6.6e-3 (by
  // scipy.stats.binom).
  ForetoldHazard hazard{{}, 0.01};
  const auto refuted = [&](std::size_t failed) {
    return FailureCount{.walks = 500, .failed = failed, .longest = 1, .foretold = 5}.refutes(hazard);
  };
  EXPECT_FALSE(refuted(0));
  EXPECT_FALSE(refuted(5));
  EXPECT_FALSE(refuted(14));
  EXPECT_TRUE(refuted(15));
  hazard.fewer = hazard.more = 0.1;  // somewhere in the mesh's interval it may be so
  EXPECT_FALSE(refuted(15));
}

TEST(FailureCount, RefutesWhatIsForetoldAndDoesNotHappenAndTheOtherWayRound) {
  EXPECT_TRUE((FailureCount{.walks = 8, .failed = 5, .longest = 4000}.refutes({{}, 1e-3})));
  EXPECT_FALSE((FailureCount{.walks = 8, .failed = 7, .longest = 4000}.refutes({{}, 1e-3})));
  EXPECT_TRUE((FailureCount{.walks = 500, .failed = 1, .longest = 4000}.refutes({{}, 0})));
  EXPECT_FALSE((FailureCount{.walks = 500, .failed = 0, .longest = 4000}.refutes({{}, 0})));
}

TEST(FailureCount, TellsBothFigures) {
  const ForetoldHazard hazard{{}, 1e-6};
  EXPECT_EQ(count_text(count_failures({0, 7, 0, 0}, 1000, hazard)),
            "1 of 4 simulated walks failed within 1000 steps, where the mesh foretells 0.004");
}

TEST(SurvivalAfter, GoesOnByRevolutions) {
  const std::vector<MeshEstimate> survival{{0.9, 0.9, 0.9}, {0.5, 0.5, 0.5}, {0.45, 0.45, 0.45}};
  const MeshEstimate half{0.5, 0.5, 0.5}, never{1, 1, 1};
  EXPECT_EQ(survival_after(survival, half, 0, 2).value, 1);
  EXPECT_EQ(survival_after(survival, never, 3, 2).value, 0.45);
  EXPECT_NEAR(survival_after(survival, half, 4, 2).value, 0.5 * 0.25, 1e-15);
  EXPECT_NEAR(survival_after(survival, half, 5, 2).value, 0.45 * 0.25, 1e-15);
  EXPECT_EQ(survival_after(survival, never, 4, 2).value, 0);
}

}  // namespace
}  // namespace metastable::markov
