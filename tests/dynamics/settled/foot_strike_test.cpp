#include "dynamics/settled/foot_strike.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "dynamics/wheel/contact_law.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

double kinetic(const ContactLever& at, const PlaneVelocity& v) {
  return (v.along * v.along + v.out * v.out + at.gyration_sq * v.spin * v.spin) / 2;
}

ContactLever some_lever() { return {uniform(-0.15, 0.15), uniform(0.05, 0.2), std::pow(uniform(0.01, 0.15), 2)}; }
PlaneVelocity some_velocity() { return {uniform(-2, 2), uniform(-2, 2), uniform(-12, 12)}; }

RC_GTEST_PROP(FootStrike, NeverGainsEnergyNorPulls, ()) {
  const ContactLever at = some_lever();
  const PlaneVelocity before = some_velocity();
  RC_PRE(at.lift(before) < 0);
  const Contact contact{uniform(0, 1), uniform(0, 1.2)};
  const PlaneVelocity after = strike(at, contact, before);
  RC_ASSERT(kinetic(at, after) <= kinetic(at, before) * (1 + 1e-13));
  RC_ASSERT(at.lift(after) >= -1e-13);
  const double press = after.out - before.out, rub = after.along - before.along;
  RC_ASSERT(press >= 0);
  RC_ASSERT(std::abs(rub) <= contact.friction * press + 1e-12);
  // Angular momentum about the contact point is kept.
  const auto about = [&](const PlaneVelocity& v) {
    return at.gyration_sq * v.spin + at.height * v.along - at.behind * v.out;
  };
  RC_ASSERT(std::abs(about(after) - about(before)) < 1e-12);
}

RC_GTEST_PROP(FootStrike, TakesWhatTheSingleImpulseLawTakes, ()) {
  // `coulomb` without later hops is the same impact in other words (energies instead of speeds), with slip, too.
  const ContactLever at{uniform(-0.1, 0.1), uniform(0.08, 0.2), std::pow(uniform(0.02, 0.1), 2)};
  const PlaneVelocity before = some_velocity();
  RC_PRE(at.lift(before) < -1e-3);
  const Contact contact{uniform(0, 1), uniform(0, 1.2)};
  ContactModel model;
  model.law = Law::coulomb;
  model.mass = 1;
  model.radius_of_gyration = std::sqrt(at.gyration_sq);
  Collision collision;
  collision.contact_x = -at.behind;
  collision.contact_y = at.height;
  collision.normal_speed = -at.lift(before);
  collision.tangential_speed = -at.slip(before);
  const Loss loss = collide(model, collision, contact);
  RC_PRE(!loss.jammed);
  const double taken = kinetic(at, before) - kinetic(at, strike(at, contact, before));
  RC_ASSERT(std::abs(taken - loss.total()) < 1e-11);
}

TEST(FootStrike, FirstImpactOfALandingThatSlips) {
  // It has omega+/omega- = 1 - (1 + eta) c (d - mu h) / (J/M + d^2 - mu d h), below the friction that sticks.
  const Triangle both = triangle(0.1524, 0.1528, std::numbers::pi / 4);
  const double d = both.contact_x, h = both.hub_height, k2 = 0.0025 / 1.39, omega = 4.8;
  const double behind = both.chord - d;
  for (const double eta : {0.0, 0.3, 0.7})
    for (const double mu : {0.0, 0.2, 0.37}) {
      const PlaneVelocity after = strike({-d, h, k2}, {eta, mu}, {omega * h, -omega * behind, omega});
      const double ratio = 1 - (1 + eta) * both.chord * (d - mu * h) / (k2 + d * d - mu * d * h);
      EXPECT_NEAR(after.spin / omega, ratio, 1e-13);
    }
}

TEST(FootStrike, SlipThatJamsEndsWithoutApproach) {
  // Painleve's case is sliding down the plane without approach, mu above (J/M + d^2) / (d h).
  const ContactLever at{-0.0583, 0.1408, 0.0018};
  const PlaneVelocity sliding{0.3 + 0.1408 * 4, 0.0583 * 4, 4};
  ASSERT_NEAR(at.lift(sliding), 0, 1e-15);
  ASSERT_GT(at.slip(sliding), 0.2);
  const PlaneVelocity after = strike(at, {0, 0.7}, sliding);
  EXPECT_NEAR(at.slip(after), 0, 1e-13);
  EXPECT_NEAR(at.lift(after), 0, 1e-13);
  EXPECT_LT(kinetic(at, after), kinetic(at, sliding));
  const PlaneVelocity kept = strike(at, {0, 0.5}, sliding);
  EXPECT_EQ(kept.spin, sliding.spin);
}

}  // namespace
}  // namespace metastable::dynamics::test
