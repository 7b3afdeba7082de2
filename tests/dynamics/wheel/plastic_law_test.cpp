#include "dynamics/wheel/plastic_law.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

ContactNoise still() { return ContactNoise::normal(0, 0, 1, 0); }

// Iterates omega+^2 -> omega-^2 of the noise-free wheel to its fixed point.
double fixed_state(const WheelMap& map) {
  double state = 30;
  for (int i = 0; i < 400; ++i) state = map.landing(state, 0, std::vector{0.0, 0.0}).value();
  return state;
}

TEST(PlasticLaw, FixedPointsOnThePapersRamps) {
  EXPECT_NEAR(std::sqrt(fixed_state(WheelMap(even_wheel(), 9.59 * degree, Law::plastic, still()))), 5.7, 0.05);
  EXPECT_NEAR(std::sqrt(fixed_state(WheelMap(even_wheel(), 7.02 * degree, Law::plastic, still()))), 4.9, 0.05);
}

TEST(PlasticLaw, RollingFixedPointOfDrakesExample) {
  Wheel wheel;
  wheel.leg_length.assign(8, 1.0);
  wheel.hub_mass = 1;
  const WheelMap map(wheel, 0.08, Law::plastic, still());
  const double state = fixed_state(map);
  EXPECT_NEAR(state, 2.4000776661, 5e-11);
  EXPECT_NEAR(std::sqrt(map.after_collision(state, 0, {0, 1})), 1.0954628396, 5e-11);
}

TEST(PlasticLaw, SlopeOfTheMapWithHubInertia) {
  for (int legs : {5, 6, 8, 12})
    for (double k : {0.0, 0.1, 0.5}) {
      Wheel wheel;
      wheel.leg_length.assign(static_cast<std::size_t>(legs), 0.7);
      wheel.radius_of_gyration = 0.7 * std::sqrt(k);
      const WheelMap map(wheel, 0.05, Law::plastic, still());
      const double ratio = (std::cos(2 * std::numbers::pi / legs) + k) / (1 + k);
      EXPECT_NEAR(map.coefficients(0, {0, 1}).scale, ratio * ratio, 1e-14);
    }
}

RC_GTEST_PROP(PlasticLaw, KeepsAngularMomentumAboutTheNewFoot, ()) {
  const double first = uniform(0.1, 0.2), second = uniform(0.1, 0.2), gyration = uniform(0, 0.1), omega = uniform(1, 9);
  Wheel wheel = even_wheel();
  wheel.radius_of_gyration = gyration;
  const Collision c = make_collision(first, second, omega, 0);
  const Loss loss = plastic_loss(contact_model(wheel, Law::plastic), c);
  const double r2 = gyration * gyration;
  const double omega_plus = omega * (first * second * std::cos(std::numbers::pi / 4) + r2) / (second * second + r2);
  const double kept = stance_inertia(wheel, Law::plastic, second) * omega_plus * omega_plus / 2;
  const double had = stance_inertia(wheel, Law::plastic, first) * omega * omega / 2;
  RC_ASSERT(std::abs(had - loss.total() - kept) < 1e-13 * had);
}

TEST(PlasticLaw, ThreeLegsCannotRollOn) {
  const Collision c = make_collision(1, 1, 1, 0, 0.1, 2 * std::numbers::pi / 3);
  EXPECT_TRUE(plastic_loss(contact_model(even_wheel(), Law::plastic), c).jammed);
}

}  // namespace
}  // namespace metastable::dynamics::test
