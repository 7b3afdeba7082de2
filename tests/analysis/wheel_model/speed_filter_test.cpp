#include "analysis/wheel_model/speed_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double degree = std::numbers::pi / 180;

// Whatever the hypothesis, the next speed and coming to rest share a probability of one: a hypothesis that does not pay
// for the rests it predicts would win over the truth.
TEST(SpeedFilter, NextSpeedAndRestShareAProbabilityOfOne) {
  dynamics::Extension plain, steeper, softer, dragged;
  steeper.geometry.slope_offset_rad = 2 * degree;
  softer.contact.restitution_exponent = 0.4;
  softer.contact.stribeck = -0.27;
  softer.contact.stribeck_speed = 8;
  dragged.torques.rolling = 0.02;
  dragged.torques.air = 4e-4;
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

// Where a score tells only part of what contacts remember, that outlasts the last score: what is left of the scores
// remembers nothing.
TEST(SpeedFilter, WhatContactsRememberOutlastsTheLastScore) {
  constexpr double rho = 0.8, told = 0.7, omega = 4.9;
  constexpr int collisions = 3000;
  const dynamics::ContactSpread contact{0.487, 0.034, 0.435, 0.037};
  dynamics::Extension extension;
  extension.contact.memory = rho;
  const dynamics::ExtendedWheel wheel(dynamics::Wheel{}, 7.02 * degree, dynamics::Law::published, contact, extension);
  const ScoreTilt tilt(0, 0);
  SpeedFilter filter(extension, tilt, 1e-4, 0, 0, 1e-3, {.linear = told});
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  double remembered = normal(generator);
  std::vector<double> left;
  for (int k = 0; k < collisions; ++k) {
    const double z = std::clamp(std::sqrt(told) * remembered + std::sqrt(1 - told) * normal(generator), -2.5, 2.5);
    const auto [low, high] = boost::math::tools::bisect(
        [&](double plus) { return wheel.after_collision({}, omega, plus).below - dynamics::normal_cdf(z); }, 0.5, 4.8,
        boost::math::tools::eps_tolerance<double>(30));
    filter.start(omega);
    left.push_back(filter.collision(wheel, {}, (low + high) / 2).score);
    remembered = rho * remembered + std::sqrt(1 - rho * rho) * normal(generator);
  }
  for (const std::size_t lag : {std::size_t{0}, std::size_t{1}, std::size_t{2}}) {
    double sum = 0;
    for (std::size_t k = lag; k < left.size(); ++k) sum += left[k] * left[k - lag] / collisions;
    EXPECT_NEAR(sum, lag == 0 ? 1 : 0, lag == 0 ? 0.1 : 3 / std::sqrt(collisions)) << lag;
  }
}

// Of a foot that sticks the next speed may go with the square of restitution's score, more than with itself.
TEST(SpeedFilter, ANegativeMemoryOfSquaresIsNone) {
  constexpr double omega = 4.9;
  dynamics::Extension extension;
  extension.contact.memory = -0.475;
  const dynamics::ExtendedWheel wheel(dynamics::Wheel{}, 7.02 * degree, dynamics::Law::published,
                                      {0.487, 0.034, 0.435, 0.037}, extension);
  const ScoreTilt tilt(0, 0);
  const auto scores = [&](const MemoryOfScores& memory) {
    SpeedFilter filter(extension, tilt, 1e-4, 0, 0, 1e-3, memory);
    std::vector<double> seen;
    for (const double plus : {2.4, 3.1, 2.7}) {
      filter.start(omega);
      seen.push_back(filter.collision(wheel, {}, plus).score);
    }
    return seen;
  };
  EXPECT_EQ(scores({.linear = 0.2, .square = 0.8}), scores({.linear = 0}));
  EXPECT_NE(scores({.linear = 0.8, .square = 0.2}), scores({.linear = 0}));
}

}  // namespace
}  // namespace metastable::analysis
