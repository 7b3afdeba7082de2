// Tests a weighted ensemble against what a finite chain says exactly.

#include "markov/splitting/weighted_ensemble.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/markov/mesh/maps.h"
#include "tests/markov/splitting/ladder.h"

namespace metastable::markov::testing {
namespace {

/// Splits by the rung, a bin each.
Levels rungs(int top) {
  Levels levels{[](int, auto states, auto level) { std::copy(states.begin(), states.end(), level.begin()); }, {{}}};
  for (int rung = 1; rung < top; ++rung) levels.edges.front().push_back(rung - 0.5);
  return levels;
}

TEST(WeightedEnsemble, FindsTheSurvivalOfAFiniteChain) {
  const Ladder ladder{.top = 8, .up = 0.2};
  const std::vector<double> exact = ladder.survival(40);
  for (const BatchMap& map : {ladder.batch(), ladder.drawing()}) {
    std::vector<double> ends;
    for (std::uint64_t stream = 0; stream < 40; ++stream) {
      WeightedEnsemble ensemble(map, std::vector{0.0}, 160, 7, stream);
      ensemble.set_levels(rungs(ladder.top));
      double failed = 0;
      for (int n = 0; n < 40; ++n) failed += ensemble.advance();
      ends.push_back(failed);
    }
    double mean = 0, squares = 0;
    for (const double end : ends) mean += end / 40;
    for (const double end : ends) squares += (end - mean) * (end - mean);
    const double error = std::sqrt(squares / 39 / 40);
    EXPECT_LT(error, 0.1 * mean);  // of 6400 walks that are not split, 1.6 fail
    EXPECT_NEAR(mean, 1 - exact.back(), 4 * error);
  }
}

TEST(WeightedEnsemble, KeepsTheWeightsAndTheNumberOfReplicas) {
  const BatchMap map = linear_batch(0.8);
  WeightedEnsemble ensemble(map, std::vector{2.0}, 200, 1, 0);
  ensemble.set_levels({[](int, auto states, auto level) {
                         for (std::size_t i = 0; i < level.size(); ++i) level[i] = -states[i];
                       },
                       {{-2, -1, -0.5}}});
  for (int n = 0; n < 50; ++n) {
    const double share = ensemble.advance();
    EXPECT_GE(share, 0);
    EXPECT_LT(share, 0.5);
    double sum = 0;
    for (const double weight : ensemble.weights()) sum += weight;
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_GE(ensemble.size(), 190U);
    EXPECT_LE(ensemble.size(), 202U);
  }
}

TEST(WeightedEnsemble, NamesAStateWithoutALevel) {
  const BatchMap map = linear_batch(0.8);
  WeightedEnsemble ensemble(map, std::vector{2.0}, 200, 1, 0);
  try {
    ensemble.set_levels({[](int, auto, auto level) { std::fill(level.begin(), level.end(), NAN); }, {{0}}});
    FAIL();
  } catch (const MapError& error) {
    EXPECT_STREQ(error.what(), "level function: it is nan at the state x = 2 (phase 0), a finite number expected");
  }
}

TEST(WeightedEnsemble, SaysThatEverythingFails) {
  BatchMap map;
  map.step = [](int, auto, auto, auto, auto failed) { std::fill(failed.begin(), failed.end(), 1); };
  WeightedEnsemble ensemble(map, std::vector{0.0}, 100, 1, 0);
  EXPECT_EQ(ensemble.advance(), 1);
  EXPECT_TRUE(ensemble.all_failed());
  EXPECT_EQ(ensemble.survival(), 0);
}

}  // namespace
}  // namespace metastable::markov::testing
