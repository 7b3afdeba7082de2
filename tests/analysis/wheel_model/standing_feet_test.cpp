#include "analysis/wheel_model/standing_feet.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

// Makes trials of the law `settled` in which one leg gives back so much of its own restitution; 0: all legs alike.
WheelRuns with_a_leg_of(double restitution) {
  Setting setting = paper_setting(7.02, true);
  setting.law = dynamics::Law::settled;
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.42, 0.03};
  setting.initial_speed = {4.8, 0.1};
  ExperimentFiles files = experiment_files(setting, simulate_trials(setting, {.trials = 12, .seed = 5}), "legs", {});
  Experiment e = parse_experiment(source_of(files, "legs"));
  const WheelRuns nominal = wheel_runs(e);
  const double lost = 1 - std::sqrt(nominal.landings.front()->legs[5].plastic);
  if (restitution > 0)
    for (MeasuredTrial& trial : e.trials)
      for (MeasuredCollision& c : trial.collisions)
        if (c.leg == 5 && *c.omega_plus > 0) c.omega_plus = c.omega_minus * (1 - (1 + restitution) * lost);
  return wheel_runs(e);
}

// A foot that gives back 0.8 still hops when the next one lands, of which `settled` says nothing.
TEST(StandingFeet, WhatFollowsLandingsOfALegThatSpringsFarMoreIsLeftOut) {
  const WheelRuns measured = with_a_leg_of(0.8);
  ASSERT_EQ(measured.springing, std::vector<bool>({false, false, false, false, false, true, false, false}));
  int first_impacts = 0;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions)
      if (m.context.leg == 5) {
        EXPECT_FALSE(m.stands);
        first_impacts += m.counted;
      }
  EXPECT_GT(first_impacts, 10);
}

TEST(StandingFeet, NoLegSpringsWhereAllAreAlikeOrOneSpringsLess) {
  for (const double restitution : {0.0, 0.15}) EXPECT_TRUE(with_a_leg_of(restitution).springing.empty()) << restitution;
}

}  // namespace
}  // namespace metastable::analysis
