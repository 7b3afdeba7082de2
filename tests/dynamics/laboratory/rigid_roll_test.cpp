#include "dynamics/laboratory/rigid_roll.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>

#include "dynamics/laboratory/laboratory.h"
#include "dynamics/settled/settled_roll.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

constexpr double hub_inertia = 0.0025;  // [kg m^2]

RollingBody rigid_body(double slope_deg) {
  RollingBody body;
  body.leg_length = paper_leg_lengths();
  body.mass = 1.39;
  body.slope_rad = slope_deg * degree;
  return body;
}

SettledWheel settled_body(double slope_deg) {
  SettledWheel wheel;
  wheel.radius_of_gyration = std::sqrt(hub_inertia / wheel.mass);
  wheel.slope_rad = slope_deg * degree;
  return wheel;
}

// The references are an independent prototype's, good to 4e-9.
TEST(RigidRoll, LandsAsTheKnownAnswersOfARigidBody) {
  struct Known {
    double slope;
    int leg;
    double omega, eta, mu, after, next, between;
  };
  const RampSurface plane;
  for (const Known& k : {Known{7.02, 1, 4.8, 0, .45, 3.4951572308, 4.8850878538, .1162628976},
                         {7.02, 1, 4.8, 0, .36, 2.8952766164, 4.8457871843, .1195052786},
                         {7.02, 1, 4.8, .4, .45, 2.9732201231, 4.8606578173, .1175822732},
                         {7.02, 1, 4.8, .4, .34, 1.3986090483, 4.5946858903, .1368071328},
                         {7.02, 6, 4.8, .4, .41, 2.9269184249, 4.7233178510, .1180811167},
                         {7.02, 6, 4.8, .4, .34, .9786060806, 0, 0},
                         {9.59, 2, 5.7, .2, .36, 3.3751187737, 5.7224499947, .1193623459},
                         {9.59, 6, 5.7, .4, .35, 1.5331455684, 5.3702803204, .1440230959}}) {
    const RollingBody body = rigid_body(k.slope);
    RigidRoll roll(body, plane, hub_inertia, k.leg, k.omega);
    const bool touched = roll.step({k.eta, k.mu});
    EXPECT_NEAR(roll.after_impact(), k.after, 1e-6);
    ASSERT_EQ(touched, k.next > 0);
    if (!touched) continue;
    EXPECT_NEAR(roll.spin(), k.next, 5e-6);
    EXPECT_NEAR(roll.position(), k.between, 5e-7);
  }
}

// The references integrate the same spring, damper and friction by Runge-Kutta steps in NumPy (steps of 1 us and 0.5 us
// agree to 5e-7), with its damping from the closed form exp(-(pi - 2 phi) tan(phi)) = eta.
TEST(RigidRoll, LandsOnSoftTipsAsAnIntegrationOfTheContactDoes) {
  struct Known {
    double slope;
    int leg;
    double omega, eta, mu, stiffness, after;
  };
  const RampSurface plane;
  for (const Known& k : {Known{9.59, 1, 5.7, .4, .45, 3e6, 3.529248},
                         {9.59, 1, 5.7, .4, .36, 3e6, 2.643996},
                         {7.02, 6, 4.9, .3, .45, 1e6, 3.103270},
                         {7.02, 6, 4.9, .3, .37, 1e6, 2.302003}}) {
    const RollingBody body = rigid_body(k.slope);
    RigidRoll roll(body, plane, hub_inertia, k.leg, k.omega, k.stiffness);
    EXPECT_TRUE(roll.step({k.eta, k.mu}));
    EXPECT_NEAR(roll.after_impact(), k.after, 1e-3);
  }
}

// The error of a stiff tip falls with the root of its stiffness.
TEST(RigidRoll, RollsOnStiffTipsAsOnRigidOnes) {
  const RampSurface plane;
  const RollingBody body = rigid_body(9.59);
  const auto next = [&](double stiffness, const Contact& contact) {
    RigidRoll roll(body, plane, hub_inertia, 2, 5.7, stiffness);
    EXPECT_TRUE(roll.step(contact));
    return roll.spin();
  };
  for (const Contact& contact : {Contact{0, .45}, {.2, .36}, {.4, .45}, {.4, .35}}) {
    const double rigid = next(0, contact);
    EXPECT_NEAR(next(1e10, contact), rigid, 1e-3) << contact.restitution << ' ' << contact.friction;
    EXPECT_NEAR(next(1e8, contact), rigid, 1e-2) << contact.restitution << ' ' << contact.friction;
  }
}

// A wheel at rest on two soft tips is not thrown up by its weight between the strikes of one and the other, which once
// took turns without an end.
TEST(RigidRoll, RestsOnSoftTipsAsOnRigidOnes) {
  const RampSurface plane;
  const RollingBody body = rigid_body(9.59);
  for (const double stiffness : {0.0, 1e10, 3e6})
    for (const Contact& contact : {Contact{.2, .3}, {.4, .25}}) {
      RigidRoll roll(body, plane, hub_inertia, 2, 5.7, stiffness);
      EXPECT_FALSE(roll.step(contact)) << stiffness << ' ' << contact.restitution;
      EXPECT_LT(roll.time(), 2);
    }
}

// Drags and many landings in a row, feet that still move among them, against the law's own event-driven motion: no code
// is shared. Near the threshold of rest both lose digits.
TEST(RigidRoll, RollsAsTheLawSettledDoes) {
  RollingBody body = rigid_body(9.59);
  SettledWheel wheel = settled_body(9.59);
  body.linear_drag = wheel.linear_drag = 2e-3;
  body.constant_drag = wheel.constant_drag = 5e-3;
  const SettledMotion motion(wheel);
  const RampSurface plane;
  std::array<Contact, 3> contacts{{{0.45, 0.36}, {0.2, 0.42}, {0.35, 0.345}}};
  RigidRoll roll(body, plane, hub_inertia, 3, 7);
  SettledRoll law(motion, 3, 7, contacts[0], contacts[0]);
  for (std::size_t n = 0; n < 12; ++n) {
    law.set_contact(contacts[n % 3]);
    const bool touched = roll.step(contacts[n % 3]);
    const Step step = law.step();
    ASSERT_EQ(touched, step.touched) << n;
    if (!touched) break;
    EXPECT_NEAR(roll.spin(), step.omega_minus, 2e-5) << n;
    EXPECT_NEAR(roll.position(), law.position(), 1e-5) << n;
    EXPECT_NEAR(roll.time(), law.time(), 1e-5) << n;
  }
}

// Random landings: both say rest or not alike, and differ in the next speed only just above the threshold of rest.
TEST(RigidRoll, LandsWhereTheLawSettledDoes) {
  std::mt19937 engine(11);
  std::uniform_real_distribution<double> uniform;
  const auto between = [&](double low, double high) { return low + (high - low) * uniform(engine); };
  const RampSurface plane;
  constexpr int landings = 400;
  int rested = 0, off = 0;
  for (const double slope : {7.02, 9.59}) {
    const RollingBody body = rigid_body(slope);
    const SettledMotion motion(settled_body(slope));
    for (int n = 0; n < landings / 2; ++n) {
      const int leg = static_cast<int>(between(0, 8));
      const double omega = between(3.5, 7);
      const Contact contact{between(0, 0.6), between(0.25, 0.55)};
      RigidRoll roll(body, plane, hub_inertia, leg, omega);
      SettledRoll law(motion, leg, omega, contact, contact);
      const bool touched = roll.step(contact);
      const Step step = law.step();
      ASSERT_EQ(touched, step.touched) << slope << " leg " << leg << " omega " << omega << " eta "
                                       << contact.restitution << " mu " << contact.friction;
      rested += !touched;
      off += touched && std::abs(roll.spin() - step.omega_minus) > 1e-4;
    }
  }
  EXPECT_GT(rested, landings / 10);
  EXPECT_LE(off, 2);
}

LaboratorySetup rigid_setup() {
  LaboratorySetup setup;
  setup.law = Law::settled;
  setup.wheel.radius_of_gyration = std::sqrt(hub_inertia / setup.wheel.hub_mass);
  setup.restitution_sd = 0.05;
  setup.friction_sd = 0.03;
  setup.max_collisions = 16;
  setup.conditions = {{7.02 * degree, 3.66, 7.35, 0.19, 1}};
  setup.order.assign(12, 0);
  return setup;
}

TEST(RigidRoll, LaboratoryRollsItWithItsOwnDrawsAndEffects) {
  LaboratorySetup setup = rigid_setup();
  const auto mean_speed = [](const LaboratorySetup& s) {
    const Laboratory lab(s);
    double sum = 0, count = 0;
    for (std::size_t t = 0; t < s.order.size(); ++t)
      for (const LaboratoryCollision& c : lab.run(t).collisions)
        if (c.position > 0.8) sum += c.omega_minus, ++count;
    return sum / count;
  };
  // Steady rolling of engines at this setting: 4.80 to 4.82 rad/s.
  const double as_stated = mean_speed(setup);
  EXPECT_NEAR(as_stated, 4.81, 0.1);
  setup.effects = {{"axle_drag_viscous", {2e-3}}};
  const double dragged = mean_speed(setup);
  EXPECT_LT(dragged, as_stated - 0.02);
  setup.effects = {{"bounce", {0.2, 0}}};
  EXPECT_EQ(message_of([&] { Laboratory{setup}; }),
            "laboratory: effect bounce acts on no rigid body; law settled has none");
  setup.law = Law::published;
  setup.effects = {{"soft_contact", {3e-7}}};
  EXPECT_EQ(message_of([&] { Laboratory{setup}; }),
            "laboratory: effect soft_contact needs impacts that last; law published has none");
}

}  // namespace
}  // namespace metastable::dynamics::test
