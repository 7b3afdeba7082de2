#include "analysis/likelihood/speed_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace metastable::analysis {
namespace {

constexpr double degree = std::numbers::pi / 180;

// Whatever the hypothesis, the next speed and coming to rest share a probability of one: a hypothesis that does not pay
// for the rests it predicts would win over the truth.
TEST(SpeedFilter, NextSpeedAndRestShareAProbabilityOfOne) {
  dynamics::Extension plain, steeper, softer, dragged;
  steeper.slope_offset_rad = 2 * degree;
  softer.restitution_exponent = 0.4;
  softer.stribeck = -0.27;
  softer.stribeck_speed = 8;
  dragged.rolling = 0.02;
  dragged.air = 4e-4;
  const dynamics::ContactSpread narrow{0.487, 0.034, 0.435, 0.037}, wide{0.466, 0.187, 0.44, 0.044};
  for (const dynamics::Extension* extension : {&plain, &steeper, &softer, &dragged})
    for (const dynamics::ContactSpread& contact : {narrow, wide})
      for (const double noise : {1e-4, 0.016})
        for (const ScoreTilt& tilt : {ScoreTilt(0, 0), ScoreTilt(-0.4, -0.2)}) {
          const dynamics::ExtendedWheel wheel(dynamics::Wheel{}, 7.02 * degree, dynamics::Law::published, contact,
                                              *extension);
          dynamics::StepContext context;
          context.leg = 2;
          context.position = 0.5;
          for (const double omega : {4.3, 5.2}) {
            SpeedFilter resting(*extension, tilt, noise);
            resting.start(omega);
            double sum = std::exp(resting.rest(wheel, context, wheel.barrier(context), true).log_density);
            const double width = 2e-3;
            for (double next = 3; next < 9; next += width) {
              SpeedFilter walking(*extension, tilt, noise);
              walking.start(omega);
              sum += width * std::exp(walking.step(wheel, context, {next}).log_density);
            }
            EXPECT_NEAR(sum, 1, 4e-3) << omega << ' ' << noise;
          }
        }
}

}  // namespace
}  // namespace metastable::analysis
