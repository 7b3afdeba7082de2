// Checks how a walker falls against walks followed step by step.

#include "analysis/walkers/walker_falls.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "analysis/statistics/median.h"
#include "analysis/walkers/walker_trials.h"
#include "markov/mesh/batch_simulation.h"

namespace metastable::analysis {
namespace {

const WalkerSetting garcia{Walker::simplest, 0.009 / degree, 0.0015 / degree, dynamics::Terrain::fresh};

// The study of which it takes the orbit and the mesh in the middle, of this spacing.
markov::MeshStudy meshed(const markov::BatchMap& map, std::span<const double> start, double spacing) {
  markov::MeshStudy study;
  study.orbit = markov::noise_free_orbit(map, start);
  study.frames = study.orbit.frames;
  study.gaits.orbits = {{study.frames.front().centre}};
  study.sizes.resize(2);
  study.sizes[1].spacing = spacing;
  return study;
}
WalkerStudy meshed(const WalkerSetting& setting, double spacing) {
  const dynamics::WalkerMap map = setting.map();
  WalkerStudy study;
  study.passage = meshed(batch_map(map),
                         gait_state(setting, dynamics::find_gait(map.walker(), setting.slope_deg * degree)), spacing);
  return study;
}

TEST(WalkerFalls, AreThoseOfWalksFollowed) {
  const WalkerStudy study = meshed(garcia, 0.6);
  const WalkerFalls falls = how_it_falls(garcia, study, {});
  ASSERT_EQ(falls.moments.last.size(), 6u);
  ASSERT_EQ(falls.moments.state_names.size(), 2u);
  const std::vector<Walk> walks = simulate_walks(garcia, {.trials = 1500, .longest = 100000});
  for (const std::size_t k : {0u, 1u, 2u}) {
    std::vector<double> angle, rate, slope;
    for (const Walk& walk : walks) {
      ASSERT_TRUE(walk.fell);
      if (walk.steps.size() <= k) continue;
      const WalkedStep& step = walk.steps[walk.steps.size() - 1 - k];
      angle.push_back(step.state[0]);
      rate.push_back(step.state[1]);
      slope.push_back(step.slope_deg);
    }
    const StepProfile& told = falls.moments.last[k];
    // Close is within a tenth of the middle 90 % of all steps: what 1500 walks and this mesh leave open.
    const auto close = [&](const Estimate& one, const Estimate& regime, const std::vector<double>& walked) {
      EXPECT_NEAR(one.value, median(walked), 0.1 * (regime.upper - regime.lower)) << k;
    };
    close(told.state[0], falls.moments.regime.state[0], angle);
    close(told.state[1], falls.moments.regime.state[1], rate);
    close(told.noise[0], falls.moments.regime.noise[0], slope);
  }
  // The nearer the fall, the surer it is; in the regime it is not.
  EXPECT_GT(falls.moments.last[0].bound_to_fail, falls.moments.last[1].bound_to_fail);
  EXPECT_GT(falls.moments.last[1].bound_to_fail, falls.moments.last[3].bound_to_fail);
  EXPECT_LT(falls.moments.regime.bound_to_fail, falls.moments.last[2].bound_to_fail);
  EXPECT_EQ(falls.moments.likeliest.size(), 6u);
}

// x' = a x + z and y' = x stands in the plane of two successive numbers: in the regime both are normal, sd 1 / sqrt(1 -
// a^2), and the nodes' rows run along the axes of x + y and x - y, so that many share an x.
TEST(WalkerFalls, QuantilesLieBetweenTheNodes) {
  constexpr double a = 0.5, normal_95_score = 1.6448536269514722;
  markov::BatchMap map;
  map.dimension = 2;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[2 * i] = a * states[2 * i] + scores[i];
      next[2 * i + 1] = states[2 * i];
      failed[i] = next[2 * i] < -4.5;
    }
  };
  for (const double spacing : {0.5, 0.3}) {
    const std::vector<double> start{0, 0};
    const WalkerFalls falls = how_it_falls(map, start, {{"z", 0, 1}}, meshed(map, start, spacing), {});
    // A mesh adds a sixth of the spacing squared to the variance at every step, the even cells half of that.
    const double sd = std::sqrt(1 / (1 - a * a)), wider = 1 + spacing * spacing / 4;
    for (const Estimate& state : falls.moments.regime.state) {
      EXPECT_NEAR(state.value, 0, 0.03 * sd) << spacing;
      EXPECT_NEAR(state.lower, -normal_95_score * sd, (wider - 1) * 2 * sd) << spacing;
      EXPECT_NEAR(state.upper, normal_95_score * sd, (wider - 1) * 2 * sd) << spacing;
      EXPECT_NEAR(state.upper + state.lower, 0, 0.05 * sd) << spacing;
    }
  }
}

// Medians that were nodes would move with these, by a tenth of the gait's sd.
TEST(WalkerFalls, QuantilesDoNotMoveWithTheNodes) {
  const WalkerSetting steady{Walker::simplest, 0.009 / degree, 0.001 / degree, dynamics::Terrain::fresh};
  std::vector<Estimate> angle;
  for (const double spacing : {0.6, 0.5})
    angle.push_back(how_it_falls(steady, meshed(steady, spacing), {}).moments.regime.state[0]);
  EXPECT_NEAR(angle[0].value, angle[1].value, 0.003 * (angle[1].upper - angle[1].lower));
}

TEST(WalkerTrials, DoNotHangOnThreadsAndAgreeWithBatches) {
  const std::vector<Walk> one = simulate_walks(garcia, {.trials = 600, .longest = 100000, .seed = 3, .threads = 1});
  const std::vector<Walk> two = simulate_walks(garcia, {.trials = 600, .longest = 100000, .seed = 3, .threads = 2});
  double mean = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].steps.size(), two[i].steps.size());
    EXPECT_EQ(one[i].steps.back().slope_deg, two[i].steps.back().slope_deg);
    mean += static_cast<double>(one[i].steps.size()) / 600;
  }
  EXPECT_NEAR(mean, 28.15, 4.5);  // 4 standard errors
  const std::vector<Walk> cut = simulate_walks(garcia, {.trials = 3, .longest = 2});
  EXPECT_LE(cut[0].steps.size(), 2u);
}

}  // namespace
}  // namespace metastable::analysis
