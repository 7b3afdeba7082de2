#include "dynamics/walkers/walker_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "dynamics/walkers/gait.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

struct Simulated {
  double mean, error;
};
/// Counts the steps before failure of `trials` walkers that start in the gait.
Simulated simulate(const WalkerMap& map, int trials) {
  std::vector<double> start = find_gait(map.walker(), map.options().slope_rad).state;
  if (map.options().terrain == Terrain::facets) start.push_back(map.options().slope_rad);
  std::mt19937_64 engine(1);
  std::normal_distribution<double> normal;
  std::vector<double> states, scores, next;
  for (int i = 0; i < trials; ++i) states.insert(states.end(), start.begin(), start.end());
  double sum = 0, squares = 0;
  for (double number = 1; !states.empty(); ++number) {
    const std::size_t n = states.size() / start.size();
    scores.resize(n);
    for (double& score : scores) score = normal(engine);
    next.resize(states.size());
    std::vector<std::uint8_t> fell(n);
    map.step(states, scores, next, fell);
    states.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (fell[i]) {
        sum += number;
        squares += number * number;
      } else {
        states.insert(states.end(), next.begin() + static_cast<std::ptrdiff_t>(i * start.size()),
                      next.begin() + static_cast<std::ptrdiff_t>((i + 1) * start.size()));
      }
    }
  }
  const double mean = sum / trials;
  return {mean, std::sqrt((squares / trials - mean * mean) / trials)};
}

void expect_agreement(const Simulated& simulated, double mean, double error) {
  EXPECT_NEAR(simulated.mean, mean, 3 * std::hypot(simulated.error, error));
}

// An independent program simulated the references (Runge-Kutta-Fehlberg with events), mean (standard error).
TEST(WalkerMap, FallsAsOftenAsAnIndependentSimulation) {
  const auto simplest = [](double sd) { return WalkerMap(TwoLinkWalker::simplest(), {0.009, sd, Terrain::fresh}); };
  const auto compass = [](double sd, Terrain terrain) {
    return WalkerMap(TwoLinkWalker::compass(), {3 * degree, sd, terrain});
  };
  expect_agreement(simulate(simplest(0.0015), 2000), 28.151, 0.059);
  expect_agreement(simulate(compass(0.02, Terrain::fresh), 4000), 8.646, 0.006);
  expect_agreement(simulate(compass(0.012, Terrain::fresh), 1500), 22.41, 0.03);
  expect_agreement(simulate(compass(0.004, Terrain::facets), 500), 68.87, 0.30);
}

TEST(WalkerMap, FacetsOfOneSlopeAreAPlane) {
  const WalkerMap plane(TwoLinkWalker::compass(), {3 * degree, 0.01, Terrain::fresh});
  const WalkerMap facets(TwoLinkWalker::compass(), {3 * degree, 0.01, Terrain::facets});
  const std::vector<double> score{0.7};
  const std::vector<double> state{0.27, -1.1, -0.4}, with_slope{0.27, -1.1, -0.4, 3 * degree + 0.7 * 0.01};
  std::vector<double> next(3), next_with_slope(4);
  std::vector<std::uint8_t> fell(1);
  plane.step(state, score, next, fell);
  facets.step(with_slope, score, next_with_slope, fell);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(next[k], next_with_slope[k]);
  EXPECT_EQ(next_with_slope[3], with_slope[3]);
}

TEST(WalkerMap, NamesWhatIsOutOfRange) {
  EXPECT_THROW(WalkerMap(TwoLinkWalker::simplest(), {2, 0.1, Terrain::fresh}), std::invalid_argument);
  EXPECT_THROW(WalkerMap(TwoLinkWalker::simplest(), {0.01, -0.1, Terrain::fresh}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::dynamics::test
