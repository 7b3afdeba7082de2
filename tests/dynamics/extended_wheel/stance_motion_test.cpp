#include "dynamics/extended_wheel/stance_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {
namespace {

WheelMap paper_map(double slope_deg) {
  return WheelMap(Wheel{}, slope_deg * std::numbers::pi / 180, Law::published,
                  ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
}

TEST(StanceMotion, KeepsItsEnergyAndRunsBackwards) {
  const StanceState start{1.2, 3.5};
  constexpr double pendulum = 127;
  const StanceState later = stance_motion(pendulum, start, 0.25);
  EXPECT_NEAR(later.speed * later.speed + pendulum * std::sin(later.angle),
              start.speed * start.speed + pendulum * std::sin(start.angle), 1e-6);
  const StanceState back = stance_motion(pendulum, later, -0.25);
  EXPECT_NEAR(back.angle, start.angle, 1e-8);
  EXPECT_NEAR(back.speed, start.speed, 1e-7);
  EXPECT_EQ(stance_motion(pendulum, start, 0).angle, start.angle);
}

TEST(StanceMotion, PassesTheNextCollisionWhenTheClosedFormSays) {
  const WheelMap map = paper_map(7.02);
  for (int phase = 0; phase < map.phases(); ++phase) {
    const Stance& stance = map.stance(phase);
    for (const double excess : {0.5, 3.0, 20.0}) {
      const double after = stance.barrier + excess;
      const auto [time, speed] =
          stance_passage(stance.pendulum, {stance.start_angle_rad, std::sqrt(after)}, stance.end_angle_rad);
      EXPECT_NEAR(time, map.duration(after + stance.gain, phase), 1e-8);
      EXPECT_NEAR(speed, std::sqrt(after + stance.gain), 1e-7);
    }
  }
}

TEST(StanceMotion, TurnsBackBelowTheBarrier) {
  const Stance stance = paper_map(7.02).stance(0);
  const double speed = std::sqrt(0.9 * stance.barrier);
  EXPECT_TRUE(std::isinf(stance_passage(stance.pendulum, {stance.start_angle_rad, speed}, stance.end_angle_rad).first));
}

}  // namespace
}  // namespace metastable::dynamics
