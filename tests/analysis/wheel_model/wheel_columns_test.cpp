#include "analysis/wheel_model/wheel_columns.h"

#include <gtest/gtest.h>

#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

TEST(WheelColumns, NothingIsFilledInWhereAllIsThere) {
  EXPECT_TRUE(completed_experiments(test::wheel_design(2, 3)).empty());
}

TEST(WheelColumns, LegsLandInTurnAndSpeedsAreAddedButAfterARest) {
  Experiment e = test::wheel_design(2, 10, false);
  e.sensor.noise_sd.reset();
  e.columns.leg = Presence::some;
  e.conditions[1].first_landing_leg = 6;
  e.trials[1].outcome = dynamics::Outcome::rest;
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) c.leg.reset();
  const auto completed = completed_experiments(e);
  ASSERT_EQ(completed.size(), 2U);
  EXPECT_EQ(completed[0].first, "leg");
  const auto& legs = completed[0].second.trials[1].collisions;
  EXPECT_EQ(completed[0].second.columns.leg, Presence::all);
  EXPECT_EQ(legs[0].leg, 6);
  EXPECT_EQ(legs[1].leg, 7);
  EXPECT_EQ(legs[2].leg, 0);
  EXPECT_FALSE(legs[0].omega_plus);
  EXPECT_EQ(completed[1].first, "omega_plus_rad_s");
  EXPECT_EQ(completed[1].second.sensor.noise_sd, imagined_noise);
  EXPECT_TRUE(completed[1].second.trials[0].collisions.back().omega_plus);
  EXPECT_FALSE(completed[1].second.trials[1].collisions.back().omega_plus);
  EXPECT_FALSE(completed[1].second.trials[1].collisions.back().leg);
}

}  // namespace
}  // namespace metastable::analysis
