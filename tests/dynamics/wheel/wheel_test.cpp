#include "dynamics/wheel/wheel.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

TEST(Wheel, PaperLegsHaveTheMeanOfTheList) {
  EXPECT_NEAR(Wheel().mean_leg_length(), 0.1519, 1e-12);
  EXPECT_EQ(Wheel().legs(), 8);
  EXPECT_FALSE(Wheel().equal_legs());
  EXPECT_TRUE(even_wheel().equal_legs());
}

TEST(Triangle, EqualLegsAreThePapersEquation36) {
  const double alpha = std::numbers::pi / 4, length = 0.1519;
  const Triangle t = triangle(length, length, alpha);
  EXPECT_NEAR(t.chord, 2 * length * std::sin(alpha / 2), 1e-15);
  EXPECT_NEAR(t.beta_first_rad, std::numbers::pi / 2 - alpha / 2, 1e-14);
  EXPECT_NEAR(t.beta_second_rad, 67.5 * degree, 1e-14);
  EXPECT_NEAR(t.contact_x, length * std::cos(t.beta_second_rad), 1e-15);
}

RC_GTEST_PROP(Triangle, AnglesSumToPiAndSidesClose, ()) {
  const double first = uniform(0.05, 2), second = uniform(0.05, 2), alpha = uniform(0.1, 2);
  const Triangle t = triangle(first, second, alpha);
  RC_ASSERT(std::abs(t.beta_first_rad + t.beta_second_rad + alpha - std::numbers::pi) < 1e-12);
  RC_ASSERT(std::abs(first * std::cos(t.beta_first_rad) + second * std::cos(t.beta_second_rad) - t.chord) < 1e-12);
  RC_ASSERT(std::abs(first * std::sin(t.beta_first_rad) - t.hub_height) < 1e-12);
  RC_ASSERT(std::abs(second * std::cos(t.beta_second_rad) - t.contact_x) < 1e-12);
}

TEST(Wheel, IllegalInputIsNamed) {
  const auto broken = [](auto change) {
    Wheel wheel;
    change(wheel);
    return message_of([&] { wheel.validate(); });
  };
  EXPECT_EQ(broken([](Wheel& w) { w.leg_length = {0.1, 0.1}; }), "leg_length: 2 legs are given, 3 or more are needed");
  EXPECT_EQ(broken([](Wheel& w) { w.leg_length[2] = -1; }), "leg_length[2]: -1 m is outside (0, inf)");
  // A leg that the hub has passed as it lands has no barrier, and one within the hull of its neighbours never lands.
  const auto legs = [&](std::vector<double> lengths) { return broken([&](Wheel& w) { w.leg_length = lengths; }); };
  const std::string hidden =
      "leg_length[0]: 0.12 m is outside (0.1202, inf) m: beside a leg of 0.17 m, 45 deg from it, a shorter one has the "
      "hub past it as it lands, or never lands";
  EXPECT_EQ(legs({0.12, 0.17, 0.12, 0.17, 0.12, 0.17, 0.12, 0.17}), hidden);
  EXPECT_EQ(legs({0.12, 0.12, 0.13, 0.14, 0.14, 0.15, 0.16, 0.17}), hidden);
  EXPECT_EQ(legs({0.121, 0.17, 0.121, 0.17, 0.121, 0.17, 0.121, 0.17}), "nothing was thrown");
  EXPECT_EQ(legs({0.1, 1, 0.1, 1}), "nothing was thrown");  // at 90 deg no leg hides another
  EXPECT_EQ(broken([](Wheel& w) { w.hub_mass = 0; }), "hub_mass: 0 kg is outside (0, inf)");
  EXPECT_EQ(broken([](Wheel& w) { w.inertia = -2; }), "inertia: -2 kg m^2 is outside (0, inf)");
  EXPECT_EQ(broken([](Wheel& w) { w.contact_mass = 0; }), "contact_mass: 0 kg is outside (0, inf)");
  EXPECT_EQ(broken([](Wheel& w) { w.ramp_stiffness = std::numeric_limits<double>::quiet_NaN(); }),
            "ramp_stiffness: nan N/m is outside (0, inf)");
  EXPECT_EQ(broken([](Wheel& w) { w.gravity = -9.81; }), "gravity: -9.81 m/s^2 is outside (0, inf)");
  EXPECT_EQ(broken([](Wheel& w) { w.radius_of_gyration = -0.1; }), "radius_of_gyration: -0.1 m is outside [0, inf)");
}

}  // namespace
}  // namespace metastable::dynamics::test
