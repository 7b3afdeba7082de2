#include "dynamics/extended_wheel/extended_wheel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/dynamics/support.h"

namespace metastable::dynamics {
namespace {

using test::degree;
constexpr ContactSpread contact{0.54, 0.045, 0.352, 0.043};

ExtendedWheel extended(const Extension& extension, Law law = Law::published) {
  return {Wheel{}, 9.59 * degree, law, contact, extension};
}

TEST(ExtendedWheel, WithoutExtensionIsTheReturnMap) {
  for (const Law law : {Law::published, Law::coulomb}) {
    const WheelMap map(Wheel{}, 9.59 * degree, law, ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
    const ExtendedWheel wheel = extended({}, law);
    for (int leg = 0; leg < 8; ++leg) {
      const Contact drawn{0.5, 0.33};
      const auto plus = wheel.omega_plus({.leg = leg, .position = 0.4}, 5.2, drawn, false);
      ASSERT_TRUE(plus);
      EXPECT_NEAR(*plus * *plus, map.after_collision(5.2 * 5.2, leg, drawn), 1e-12);
      EXPECT_NEAR(std::pow(wheel.barrier({.leg = leg}), 2), map.stance(leg).barrier, 1e-12);
      const auto next = wheel.next({.leg = leg}, *plus);
      ASSERT_TRUE(next);
      EXPECT_NEAR(*next * *next, *plus * *plus + map.stance(leg).gain, 1e-12);
      EXPECT_NEAR(wheel.duration({.leg = leg}, *plus), map.duration(*next * *next, leg), 1e-6);
    }
  }
}

// Holds the stance with torques, step by step in time, against the energy balance of the extension.
TEST(ExtendedWheel, TorquesTakeTheirWork) {
  Extension extension;
  extension.torques.rolling = 0.008;
  extension.torques.viscous = 0.0015;
  extension.torques.air = 0.0003;
  const ExtendedWheel wheel = extended(extension);
  const Wheel plain;
  const double inertia = stance_inertia(plain, Law::published, 0.1519);
  for (const int leg : {0, 3}) {
    const double plus = 3.6;
    const Triangle landed = triangle(plain.leg_length[static_cast<std::size_t>((leg + 7) % 8)],
                                     plain.leg_length[static_cast<std::size_t>(leg)], plain.leg_angle());
    const Triangle ahead = triangle(plain.leg_length[static_cast<std::size_t>(leg)],
                                    plain.leg_length[static_cast<std::size_t>((leg + 1) % 8)], plain.leg_angle());
    double theta = landed.beta_second_rad + 9.59 * degree, omega = plus;
    const double end = std::numbers::pi - (ahead.beta_first_rad - 9.59 * degree);
    constexpr double step = 1e-6;
    while (theta < end) {  // midpoint rule
      const auto rate = [&](double angle, double speed) {
        return (-plain.hub_mass * plain.gravity * plain.leg_length[static_cast<std::size_t>(leg)] * std::cos(angle) -
                extension.torques.rolling - extension.torques.viscous * speed - extension.torques.air * speed * speed) /
               inertia;
      };
      const double half_angle = theta + omega * step / 2, half_speed = omega + rate(theta, omega) * step / 2;
      theta += half_speed * step;
      omega += rate(half_angle, half_speed) * step;
    }
    const auto next = wheel.next({.leg = leg}, plus);
    ASSERT_TRUE(next);
    EXPECT_NEAR(*next, omega, 1e-4);  // the torques take 0.13 rad/s here
    const auto back = wheel.back({.leg = leg}, *next);
    ASSERT_TRUE(back);
    EXPECT_NEAR(*back, plus, 1e-5);
  }
}

TEST(ExtendedWheel, DensityIsThatOfDrawnSteps) {
  std::vector<Extension> cases(10);
  cases[0].contact.leg = 2, cases[0].contact.leg_friction = 1.2, cases[0].contact.leg_restitution = 0.9;
  cases[1].contact.stribeck = 0.4, cases[1].contact.stribeck_speed = 4;
  cases[2].contact.restitution_exponent = 0.3;
  cases[3].contact.patch_from = 0.2, cases[3].contact.patch_to = 0.6, cases[3].contact.patch_friction = 0.8;
  cases[4].contact.drift = 0.2;
  cases[5].contact.outlier_share = 0.2, cases[5].contact.outlier_friction = 1.3;
  cases[6].contact.rebound_lost = 0.3;
  cases[7].contact.ring_cosine = 0.1, cases[7].contact.ring_sine = -0.05, cases[7].contact.ring_frequency = 7;
  cases[8].geometry.inertia_ratio = 1.05, cases[8].geometry.slope_offset_rad = 0.5 * degree,
  cases[8].geometry.leg_change.assign(8, 1e-3);
  const StepContext context{
      .leg = 2, .position = 0.4, .since_previous = 0.21, .run_share = 0.7, .friction_shift = 0.01};
  StepContext varied = context;  // the last case: nothing but what this collision's friction does by itself
  varied.friction_ratio = 1.15, varied.friction_scatter = 2;
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  for (const Extension& extension : cases)
    for (const Law law : {Law::published, Law::coulomb}) {
      const ExtendedWheel wheel = extended(extension, law);
      const StepContext& here = &extension == &cases.back() ? varied : context;
      const double at = law == Law::published ? 3.5 : 4.2;
      constexpr int draws = 20000;
      int below = 0;
      for (int i = 0; i < draws; ++i) {
        const Contact drawn{0.54 + 0.045 * normal(generator), 0.352 + 0.043 * normal(generator)};
        const auto plus = wheel.omega_plus(here, 5.3, drawn, uniform(generator) < extension.contact.outlier_share);
        below += !plus || *plus <= at;
      }
      const double expected = wheel.after_collision(here, 5.3, at).below;
      EXPECT_NEAR(static_cast<double>(below) / draws, expected, 4 * std::sqrt(expected * (1 - expected) / draws) + 1e-3)
          << &extension - cases.data();
    }
}

TEST(ExtendedWheel, FeetHopFromTheirOnsetOn) {
  Extension hopping;
  hopping.contact.rebound_lost = 0.5;
  hopping.contact.hops_from = 5;
  const ExtendedWheel wheel = extended(hopping), plain = extended({});
  const Contact drawn{0.5, 0.35};
  EXPECT_EQ(wheel.omega_plus({.leg = 0}, 4.9, drawn, false), plain.omega_plus({.leg = 0}, 4.9, drawn, false));
  EXPECT_LT(*wheel.omega_plus({.leg = 0}, 5, drawn, false), *plain.omega_plus({.leg = 0}, 5, drawn, false) - 0.1);
  EXPECT_EQ(wheel.after_collision({.leg = 0}, 4.9, 3.4).below, plain.after_collision({.leg = 0}, 4.9, 3.4).below);
  EXPECT_GT(wheel.after_collision({.leg = 0}, 5, 3.4).below, plain.after_collision({.leg = 0}, 5, 3.4).below);
}

// A sag is a stretch of another slope's mean: the energy over the whole stretch is that of the drop in height.
TEST(ExtendedWheel, SagGivesBackWhatItTook) {
  for (const auto shape :
       {Extension::Geometry::Shape::parabola, Extension::Geometry::Shape::sine, Extension::Geometry::Shape::step}) {
    Extension extension;
    extension.geometry.sag = 0.004;
    extension.geometry.sag_shape = shape;
    extension.geometry.sag_to = 1.8;
    const ExtendedWheel wheel = extended(extension), level = extended({});
    double gained = 0, plain = 0;
    for (double position = 0.06; position < 1.8; position += 0.12) {
      const StepContext context{.leg = 0, .position = position};
      gained += std::pow(*wheel.next(context, 4.0), 2) - 16;
      plain += std::pow(*level.next(context, 4.0), 2) - 16;
    }
    EXPECT_NEAR(gained, plain, 0.02 * plain);
    EXPECT_GT(*wheel.next({.leg = 0, .position = 0.3}, 4.0), *level.next({.leg = 0, .position = 0.3}, 4.0));
  }
}

// The centre of mass of a wheel with equal legs comes back to its height after a revolution.
TEST(ExtendedWheel, EccentricityAveragesOut) {
  Extension extension;
  extension.geometry.hub_forward = 0.001;
  extension.geometry.hub_aside = -0.0005;
  const ExtendedWheel wheel(test::even_wheel(), 9.59 * degree, Law::published, contact, extension);
  const ExtendedWheel plain(test::even_wheel(), 9.59 * degree, Law::published, contact, {});
  double change = 0, size = 0;
  for (int leg = 0; leg < 8; ++leg) {
    const double d = std::pow(*wheel.next({.leg = leg}, 4.0), 2) - std::pow(*plain.next({.leg = leg}, 4.0), 2);
    change += d;
    size = std::max(size, std::abs(d));
  }
  EXPECT_GT(size, 0.2);
  EXPECT_NEAR(change, 0, 1e-10);
}

}  // namespace
}  // namespace metastable::dynamics
