// Tests the last steps of replicas that fail against a finite chain, whose shares are known.

#include "markov/splitting/failing_walks.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "markov/splitting/weighted_ensemble.h"
#include "tests/markov/splitting/ladder.h"

namespace metastable::markov::testing {
namespace {

FailingWalks walks_of(std::vector<double> weights) {
  FailingWalks walks{1, 1, 0, std::move(weights), {}, {}, {}};
  for (std::size_t i = 0; i < walks.size(); ++i) {
    walks.phases.push_back(0);
    walks.states.push_back(static_cast<double>(i));
  }
  return walks;
}

// Walks are kept at even places along the weights: one that has half of the whole weight becomes half of those kept.
TEST(FailingWalks, AreThinnedByWeight) {
  FailingWalks walks = walks_of({1, 4, 1, 1, 1});
  walks.thin(8, 0.5);
  EXPECT_EQ(walks.size(), 5u);  // no more than asked: nothing changes
  walks.thin(4, 0.5);
  EXPECT_EQ(walks.states, (std::vector<double>{1, 1, 2, 4}));
  EXPECT_EQ(walks.weights, (std::vector<double>{2, 2, 2, 2}));
}

// A walk that fails climbs the ladder's last five rungs; the sixth step before began on rung 2 and climbed, or on rung
// 6 or 7 and fell to 3, in the shares of the quasi-stationary distribution.
TEST(FailingWalks, AreThoseOfAFiniteChain) {
  const Ladder ladder{.top = 8, .up = 0.2};
  std::vector<double> quasi(8, 0.125);
  for (int n = 0; n < 1000; ++n) {
    std::vector<double> after(8, 0.0);
    for (std::size_t rung = 0; rung < 8; ++rung) {
      if (rung < 7) after[rung + 1] += ladder.up * quasi[rung];
      after[rung / 2] += (1 - ladder.up) * quasi[rung];
    }
    const double whole = std::accumulate(after.begin(), after.end(), 0.0);
    for (std::size_t rung = 0; rung < 8; ++rung) quasi[rung] = after[rung] / whole;
  }
  const double climbed = ladder.up * quasi[2], fell = (1 - ladder.up) * (quasi[6] + quasi[7]);
  for (const BatchMap& map : {ladder.batch(), ladder.drawing()}) {
    double weight = 0, from_two = 0;
    for (std::uint64_t stream = 0; stream < 20; ++stream) {
      WeightedEnsemble ensemble(map, std::vector{0.0}, 160, 11, stream);
      Levels levels{[](int, auto states, auto level) { std::copy(states.begin(), states.end(), level.begin()); }, {{}}};
      for (int rung = 1; rung < 8; ++rung) levels.edges.front().push_back(rung - 0.5);
      ensemble.set_levels(levels);
      for (int n = 0; n < 30; ++n) ensemble.advance();
      ensemble.remember(6, 400);
      for (int n = 0; n < 100; ++n) ensemble.advance();
      const FailingWalks& walks = ensemble.failing();
      ASSERT_GT(walks.size(), 100u);
      EXPECT_LE(walks.size(), 800u);
      for (std::size_t walk = 0; walk < walks.size(); ++walk) {
        for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(walks.state(walk, k)[0], 7 - static_cast<double>(k));
        weight += walks.weights[walk];
        from_two += walks.weights[walk] * (walks.state(walk, 5)[0] == 2);
      }
    }
    EXPECT_NEAR(from_two / weight, climbed / (climbed + fell), 0.05);
  }
}

}  // namespace
}  // namespace metastable::markov::testing
