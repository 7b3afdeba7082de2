#include "markov/splitting/learnt_level.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "markov/splitting/weighted_ensemble.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

// Lets an ensemble walk by the map x' = x / 2 + 1 + sd z, which fails below 0, and learns a level from the states that
// it visits.
LearntLevel learnt(double sd) {
  const BatchMap map = testing::linear_batch(sd);
  const std::vector<double> start{2};
  WeightedEnsemble ensemble(map, start, 400, 1, 0);
  Visits visits;
  visits.phases.resize(1);
  for (int n = 0; n < 30; ++n) {
    ensemble.advance();
    if (n >= 10) visits.add(ensemble);
  }
  const std::vector<VisitFrame> frames{VisitFrame(map, visits.phases[0])};
  return learn_level(map, frames, visits, {{}}, {.anchors = 300, .window = 10, .seed = 1, .stream = 5});
}

TEST(LearntLevel, IsHigherWhereFailureIsNearer) {
  const LearntLevel found = learnt(0.5);
  ASSERT_TRUE(found.level);
  EXPECT_EQ(found.window, 10);
  std::vector<double> states{0.6, 1.5, 2.4}, levels(3);
  found.level(0, states, levels);
  EXPECT_GT(levels[0], levels[1]);
  EXPECT_GT(levels[1], levels[2]);
}

// With an sd of 0.05 no visited state leads to failure. A level learnt from chances that are all zero would split
// nothing, so that none is given.
TEST(LearntLevel, IsNoneWhereFailureIsNotReached) {
  const LearntLevel found = learnt(0.05);
  EXPECT_FALSE(found.level);
  EXPECT_GT(found.calls, 0U);
}

}  // namespace
}  // namespace metastable::markov
