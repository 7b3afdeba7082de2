#include "analysis/description/speed_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {
namespace {

TEST(SpeedProfile, CountsOnlyTheTrialsThatGotThere) {
  const TrialSpeeds trials = {{5, 4, 3}, {7, 6}, {6}};
  const auto profile = speed_profile(trials);
  ASSERT_EQ(profile.size(), 3u);
  EXPECT_EQ(profile[0].count, 3u);
  EXPECT_DOUBLE_EQ(profile[0].mean, 6);
  EXPECT_DOUBLE_EQ(profile[0].sd, 1);
  EXPECT_DOUBLE_EQ(profile[0].standard_error, 1 / std::sqrt(3.0));
  EXPECT_EQ(profile[2].count, 1u);
  EXPECT_EQ(profile[2].standard_error, 0);
  EXPECT_EQ(steady_speeds(trials, 2).size(), 3u);
  EXPECT_EQ(steady_trial_means(trials, 2), (std::vector<double>{3.5, 6}));
}

TEST(SpeedProfile, ReturnMapLineOfALine) {
  TrialSpeeds trials;
  for (const double start : {3.0, 8.0}) {
    std::vector<double>& one = trials.emplace_back();
    for (double x = start; one.size() < 6; x = 2 + 0.6 * x) one.push_back(x);
  }
  const auto line = return_map_line(trials, 1);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->pairs, 10u);
  EXPECT_NEAR(line->slope, 0.6, 1e-12);
  EXPECT_NEAR(*line->fixed_point, 5, 1e-12);
  EXPECT_NEAR(line->slope_error, 0, 1e-12);
  EXPECT_FALSE(return_map_line({{1, 1, 1}}, 1));
}

TEST(SpeedProfile, LegsOfTheStandIn) {
  const Experiment experiment = read_experiment(std::filesystem::path(METASTABLE_TEST_DATA) / "stand-in");
  const auto legs = speed_per_leg(experiment, 2, steady_collision);
  ASSERT_TRUE(legs);
  ASSERT_EQ(legs->size(), 8u);
  EXPECT_EQ((*legs)[0].count, 0u);  // collisions 13 to 16 land on legs 4 to 7
  EXPECT_GT((*legs)[4].count, 40u);
  Experiment unknown = experiment;
  for (MeasuredTrial& trial : unknown.trials)
    for (MeasuredCollision& c : trial.collisions) c.leg.reset();
  EXPECT_FALSE(speed_per_leg(unknown, 2, steady_collision));
}

}  // namespace
}  // namespace metastable::analysis
