#include "dynamics/settled/soft_contact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/extended_wheel/extended_wheel.h"
#include "dynamics/laboratory/rigid_roll.h"
#include "dynamics/settled/landing_grid.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

constexpr double hub_inertia = 0.0025;  // [kg m^2]
constexpr double slope = 9.59 * degree;
constexpr ContactSpread usual{0.4, 0.05, 0.4, 0.03};

// The wheel has equal legs, so that the grid of one leg serves all of them.
Wheel equal_wheel() {
  Wheel wheel;
  wheel.leg_length.assign(8, 0.152);
  wheel.radius_of_gyration = std::sqrt(hub_inertia / wheel.hub_mass);
  return wheel;
}

ExtendedWheel on_tips_of(double stiffness, const ContactSpread& contact = usual) {
  static const auto grid = landing_grid(settled_wheel(equal_wheel(), slope), 4, 7, usual);
  Extension extension;
  if (stiffness > 0) extension.contact.softness = 1 / std::sqrt(stiffness);
  return {equal_wheel(), slope, Law::settled, contact, extension, grid};
}

double after(const ExtendedWheel& wheel, double omega, const Contact& contact) {
  return wheel.omega_plus({}, omega, contact, false).value();
}

// Integrates the equation of SpringImpact by Runge-Kutta steps.
TEST(SpringImpact, IsTheMotionOfADampedOscillator) {
  using State = std::array<double, 2>;  // x, x'
  for (const double eta : {0.03, 0.13, 0.4, 0.7, 0.94}) {
    const SpringImpact impact(eta);
    const double z = impact.damping, step = 1e-4;
    const auto force = [&](const State& s) { return s[0] + 2 * z * s[1]; };
    const auto moved = [&](const State& s, const State& by, double time) {
      return State{s[0] + time * by[1], s[1] - time * force(by)};
    };
    State s{0, 1};
    double time = 0, given = 0, weighted = 0, run = 0, run_twice = 0;
    while (force(s) > 0) {
      const State b = moved(s, s, step / 2), c = moved(s, b, step / 2), d = moved(s, c, step);
      const State old = s;
      s[0] += step / 6 * (old[1] + 2 * b[1] + 2 * c[1] + d[1]);
      s[1] -= step / 6 * (force(old) + 2 * force(b) + 2 * force(c) + force(d));
      const double pushed = old[1] - s[1], share = (1 - (old[1] + s[1]) / 2) / (1 + eta);
      given += pushed;
      weighted += pushed * (time + step / 2);
      run += share * step;
      run_twice += share * share * step;
      time += step;
    }
    EXPECT_NEAR(given, 1 + eta, 1e-4) << eta;
    EXPECT_NEAR(impact.lasts, time, 2e-4) << eta;
    EXPECT_NEAR(impact.depth, s[0], 2e-4) << eta;
    EXPECT_NEAR(impact.weighted, weighted / (1 + eta), 2e-4) << eta;
    EXPECT_NEAR(impact.run, run, 2e-4) << eta;
    EXPECT_NEAR(impact.run_twice, run_twice, 2e-4) << eta;
  }
}

TEST(SoftContact, OfStiffTipsIsTheRigidLawAndPartsFromItInProportionToTheSoftness) {
  const ExtendedWheel rigid = on_tips_of(0), stiff = on_tips_of(1e10), soft = on_tips_of(1e8);
  for (const Contact& contact : {Contact{0.4, 0.45}, {0.4, 0.36}, {0.2, 0.35}}) {
    const double limit = after(rigid, 5.7, contact);
    EXPECT_NEAR(after(stiff, 5.7, contact), limit, 4e-3);
    EXPECT_NEAR((after(soft, 5.7, contact) - limit) / (after(stiff, 5.7, contact) - limit), 10, 0.15);
  }
}

// The second laboratory integrates the contact. Softness itself changes omega+ of a foot that sticks by 1e-3 to 3e-3 of
// omega- at 3e6 N/m, and of one that slides by 1.5e-2 to 2.5e-2.
TEST(SoftContact, IsWhatAnIntegrationOfTheContactGives) {
  const RampSurface plane;
  RollingBody body;
  body.leg_length = equal_wheel().leg_length;
  body.mass = equal_wheel().hub_mass;
  body.slope_rad = slope;
  const auto off = [&](double omega, const Contact& contact, double stiffness) {
    RigidRoll roll(body, plane, hub_inertia, 0, omega, stiffness);
    roll.step(contact);
    const ExtendedWheel wheel = on_tips_of(stiffness, {contact.restitution, 0.05, 0.4, 0.03});
    return (after(wheel, omega, contact) - roll.after_impact()) / omega;
  };
  for (const double omega : {4.9, 6.7})
    for (const double eta : {0.25, 0.4, 0.55}) {
      EXPECT_NEAR(off(omega, {eta, 0.45}, 3e6), 0, 1e-3) << omega << ' ' << eta;
      EXPECT_NEAR(off(omega, {eta, 0.45}, 3e7), 0, 3e-4) << omega << ' ' << eta;
      EXPECT_NEAR(off(omega, {eta, 0.36}, 3e6), 0, 5e-3) << omega << ' ' << eta;
    }
}

}  // namespace
}  // namespace metastable::dynamics::test
