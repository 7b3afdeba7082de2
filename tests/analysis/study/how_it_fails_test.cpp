// Checks how the wheel fails against trials followed collision by collision.

#include "analysis/study/how_it_fails.h"

#include <gtest/gtest.h>

#include <cmath>

#include "analysis/statistics/median.h"
#include "dynamics/return_map/trials.h"

namespace metastable::analysis {
namespace {

struct Observed {
  std::vector<double> speed, friction, restitution, by_leg = std::vector<double>(8, 0.0);
};

Observed follow(const Setting& setting, int trials, std::size_t before) {
  Observed seen;
  const dynamics::WheelMap map = setting.map();
  const dynamics::TrialOptions options{.max_collisions = 100000, .ramp_length = INFINITY};
  for (int i = 0; i < trials; ++i) {
    const dynamics::Trial trial =
        dynamics::simulate_trial(map, setting.launch(), options, static_cast<std::uint64_t>(i));
    seen.by_leg[static_cast<std::size_t>(trial.collisions.back().leg)] += 1.0 / trials;
    if (trial.collisions.size() < before + 2) continue;
    const dynamics::TrialCollision& collision = trial.collisions[trial.collisions.size() - 1 - before];
    seen.speed.push_back(collision.omega_minus);
    seen.friction.push_back(collision.contact.friction);
    seen.restitution.push_back(collision.contact.restitution);
  }
  return seen;
}

TEST(HowItFails, IsWhatTrialsShow) {
  const Setting setting;  // the paper's gentle ramp under the published law
  const StudyOptions options{.cells = 128, .samples = 2048, .replicates = 2, .brief = true};
  const LastMoments told = how_it_fails(setting, study(setting, options), options);
  ASSERT_EQ(told.reason, "");
  const int trials = 6000;
  for (const std::size_t k : {0u, 1u}) {
    const Observed seen = follow(setting, trials, k);
    EXPECT_NEAR(told.last[k].state[0].value, median(seen.speed), 0.06) << k;
    EXPECT_NEAR(told.last[k].noise[0].value, median(seen.restitution), 0.012) << k;
    EXPECT_NEAR(told.last[k].noise[1].value, median(seen.friction), 0.012) << k;
    if (k > 0) continue;
    double all = 0;
    for (std::size_t leg = 0; leg < 8; ++leg) {
      EXPECT_NEAR(told.by_phase[leg], seen.by_leg[leg], 4 * std::sqrt(0.25 / trials)) << leg;
      all += told.by_phase[leg];
    }
    EXPECT_NEAR(all, 1, 1e-9);
  }
  EXPECT_GT(told.last[0].bound_to_fail, told.last[2].bound_to_fail);
  EXPECT_FALSE(told.likeliest.back().noise.empty());
}

TEST(HowItFails, SaysWhyThereIsNothingToTell) {
  Setting setting;
  setting.law = dynamics::Law::plastic;
  const StudyOptions options{.cells = 32, .samples = 256, .brief = true};
  EXPECT_NE(how_it_fails(setting, study(setting, options), options).reason, "");
}

TEST(MiddleNinety, IsThatOfWeights) {
  const std::vector<double> values{3, 1, 2}, weights{1, 1, 0};
  const Estimate middle = middle_90(values, weights);
  EXPECT_DOUBLE_EQ(middle.value, 2);
  EXPECT_DOUBLE_EQ(middle.lower, 1);
  EXPECT_DOUBLE_EQ(middle.upper, 3);
  const std::vector<double> one{1};
  EXPECT_THROW(middle_90(values, one), std::invalid_argument);
  EXPECT_THROW(middle_90(values, weights, one), std::invalid_argument);
  EXPECT_THROW(middle_90(values, std::vector<double>{0, 0, 0}), std::invalid_argument);
}

// Of nodes that share a value, as the rows of a lattice do, each on its own would pull the quantile to it.
TEST(MiddleNinety, OfEqualValuesInterpolatesBetweenThem) {
  std::vector<double> values, weights;
  for (const double node : {0.0, 1.0, 2.0, 3.0})
    for (int k = 0; k < 100; ++k) {
      values.push_back(node + 1e-15 * k);
      weights.push_back(node + 1);
    }
  // Middles of weights at 0.05, 0.2, 0.45 and 0.8.
  const Estimate middle = middle_90(values, weights);
  EXPECT_NEAR(middle.value, 2 + 0.05 / 0.35, 1e-12);
  EXPECT_NEAR(middle.lower, 0, 1e-12);
  EXPECT_NEAR(middle.upper, 3, 1e-12);
}

// The nodes of a lattice with the weights of a distribution tell its quantiles to the square of the spacing.
TEST(MiddleNinety, OfCellsIsThatOfTheirDistribution) {
  for (const double spacing : {0.5, 0.25, 0.125}) {
    std::vector<double> values, weights;
    for (double x = -8.03; x < 8; x += spacing) {
      values.push_back(x);
      weights.push_back(0.5 *
                        (std::erfc(-(x + spacing / 2) / std::sqrt(2)) - std::erfc(-(x - spacing / 2) / std::sqrt(2))));
    }
    const Estimate middle = middle_90(values, weights, std::vector<double>(values.size(), spacing));
    EXPECT_NEAR(middle.lower, -1.6448536269514722, 0.25 * spacing * spacing);
    EXPECT_NEAR(middle.upper, 1.6448536269514722, 0.25 * spacing * spacing);
    EXPECT_NEAR(middle.value, 0, 0.1 * spacing * spacing);
  }
}

}  // namespace
}  // namespace metastable::analysis
