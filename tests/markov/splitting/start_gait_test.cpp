#include "markov/splitting/start_gait.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/markov/mesh/maps.h"

namespace metastable::markov::testing {
namespace {

TEST(StartGait, KnowsWhatLeadsToAnotherGaitToItsOwnAndToFailure) {
  const BatchMap map = TwoGaits{.sd = 0.3, .far = 0.9}.batch();
  StartGait gait(map, std::vector<double>{-1}, {0.3});
  ASSERT_FALSE(gait.none());
  EXPECT_EQ(gait.left(std::vector<double>{-1.8, -0.2, 0.1, 0.9, -0.9}), (std::vector<std::uint8_t>{0, 0, 1, 1, 0}));
  ASSERT_EQ(gait.elsewhere().size(), 1U);
  EXPECT_NEAR(gait.elsewhere()[0], 1, 0.02);
  EXPECT_GT(gait.calls(), 0U);
}

TEST(StartGait, TakesAllTurnsOfAnOrbitForOne) {
  BatchMap map;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = 3.2 * states[i] * (1 - states[i]) + 0.001 * scores[i];
      failed[i] = next[i] < 0 || next[i] > 1;
    }
  };
  StartGait gait(map, std::vector<double>{0.51}, {0.01});
  EXPECT_EQ(gait.left(std::vector<double>{0.5130, 0.7995, 0.2}), (std::vector<std::uint8_t>{0, 0, 0}));
  EXPECT_TRUE(gait.elsewhere().empty());
}

TEST(StartGait, ThereIsNoneWhereTheStartFailsWithoutNoiseOrTheMapDraws) {
  BatchMap falls;
  falls.step = [](int, auto states, auto, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) next[i] = states[i] + 1, failed[i] = next[i] > 20;
  };
  EXPECT_TRUE(StartGait(falls, std::vector<double>{0}, {1}).none());
  BatchMap draws;
  draws.scores = 0;
  draws.draw = [](int, auto states, auto, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) next[i] = states[i], failed[i] = 0;
  };
  EXPECT_TRUE(StartGait(draws, std::vector<double>{0}, {1}).none());
}

}  // namespace
}  // namespace metastable::markov::testing
