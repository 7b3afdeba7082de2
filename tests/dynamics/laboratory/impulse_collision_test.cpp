#include "dynamics/laboratory/impulse_collision.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

Impact impact_of(Law law, const Collision& c, const ContactModel& model, const Contact& contact) {
  return {.law = law,
          .mass = model.mass,
          .gyration = law == Law::published ? c.landing_length : model.radius_of_gyration,
          .behind = c.contact_x,
          .above = c.contact_y,
          .approach = c.normal_speed,
          .along = -c.tangential_speed,
          .restitution = contact.restitution,
          .friction = contact.friction,
          .slope_rad = c.slope_rad,
          .gravity = model.gravity,
          .stiffness = model.ramp_stiffness,
          .contact_mass = model.contact_mass};
}

// There are two ways to the same numbers: closed forms of the laws, and the march along the impulse.
RC_GTEST_PROP(ImpulseCollision, AgreesWithTheLawsOverTheWholeBox, ()) {
  Wheel wheel = even_wheel();
  wheel.radius_of_gyration = uniform(0.02, 0.2);
  const double tangential = uniform(-1, 1) < 0 ? 0 : uniform(-3, 3);
  const Collision c = make_collision(uniform(0.12, 0.18), uniform(0.12, 0.18), uniform(0.5, 10), tangential, 0.15);
  const Contact contact{uniform(0.01, 1), uniform(0, 2)};
  for (const Law law : {Law::published, Law::coulomb}) {
    const ContactModel model = contact_model(wheel, law);
    const Loss loss = collide(model, c, contact);
    const ImpactWork work = integrate_impact(impact_of(law, c, model, contact));
    const double scale = model.mass * (c.normal_speed * c.normal_speed + tangential * tangential);
    RC_ASSERT(work.jammed == loss.jammed);
    if (loss.jammed) continue;
    RC_ASSERT(std::abs(work.normal - loss.normal()) <= 1e-9 * scale);
    RC_ASSERT(std::abs(work.friction - loss.tangential()) <= 1e-9 * scale);
    RC_ASSERT(std::abs(work.potential - loss.potential) <= 1e-9 * scale);
  }
}

// It is half a period of the damped oscillator, pi / sqrt(K/m (1 - xi^2)).
TEST(ImpulseCollision, ClosedTimeOfTheKelvinVoigtRamp) {
  for (const double xi : {0.0, 0.1, 0.3, 0.7, 0.95}) {
    const double eta = std::exp(-xi * std::numbers::pi / std::sqrt(1 - xi * xi));
    const double exact = std::numbers::pi / std::sqrt(9000 / 1.39 * (1 - xi * xi));
    EXPECT_NEAR(closed_time(9000, 1.39, eta) / exact, 1, 1e-10) << "xi " << xi;
  }
}

}  // namespace
}  // namespace metastable::dynamics::test
