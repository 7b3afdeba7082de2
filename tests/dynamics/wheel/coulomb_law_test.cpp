#include "dynamics/wheel/coulomb_law.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>

#include "dynamics/wheel/plastic_law.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

struct Work {
  double normal = 0, friction = 0;
};

// Integrates otherwise: small steps of normal impulse, friction from an implicit step (stick if the cone allows it).
Work stepped(const ContactModel& m, const Collision& c, const Contact& contact) {
  const double x = c.contact_x, y = c.contact_y, r2 = m.radius_of_gyration * m.radius_of_gyration,
               scale = 1 / (m.mass * r2);
  const double nn = (r2 + x * x) * scale, nt = x * y * scale, tt = (r2 + y * y) * scale;
  double vn = -c.normal_speed, vt = -c.tangential_speed;
  const double step = 2e-5 * m.mass * std::max(c.normal_speed, std::abs(c.tangential_speed));
  double absorbed = 0, released = 0, friction = 0;
  for (;;) {
    const double wanted = -(vt + nt * step) / tt;
    const double tangential = std::clamp(wanted, -contact.friction * step, contact.friction * step);
    const double vn_next = vn + nn * step + nt * tangential, vt_next = vt + tt * tangential + nt * step;
    const double work = step * (vn + vn_next) / 2;
    friction += -tangential * (vt + vt_next) / 2;
    if (vn_next <= 0)
      absorbed -= work;
    else if (vn < 0) {  // the step that ends compression
      const double part = vn / (vn - vn_next);
      absorbed -= step * part * vn / 2;
      released += step * (1 - part) * vn_next / 2;
    } else
      released += work;
    vn = vn_next;
    vt = vt_next;
    if (vn > 0 && released >= contact.restitution * contact.restitution * absorbed) break;
  }
  return {absorbed * (1 - contact.restitution * contact.restitution), friction};
}

void compare(const ContactModel& model, const Collision& c, const Contact& contact) {
  const Work reference = stepped(model, c, contact);
  const Loss loss = coulomb_loss(model, c, contact);
  const double scale = model.mass * (c.normal_speed * c.normal_speed + c.tangential_speed * c.tangential_speed);
  EXPECT_NEAR(loss.normal(), reference.normal, 3e-4 * scale)
      << "eta " << contact.restitution << " mu " << contact.friction << " u0 " << c.tangential_speed;
  EXPECT_NEAR(loss.tangential(), reference.friction, 3e-4 * scale)
      << "eta " << contact.restitution << " mu " << contact.friction << " u0 " << c.tangential_speed;
}

// It has v0 = 0.6 m/s. Uphill slip stops in compression / restitution / never; downhill slip; jam until slip stops.
TEST(CoulombLaw, AgreesWithSteppedImpulseInEveryPhase) {
  Wheel wheel = even_wheel();
  for (double gyration : {0.03, 0.05, 0.15}) {
    wheel.radius_of_gyration = gyration;
    const ContactModel model = contact_model(wheel, Law::coulomb);
    for (double tangential : {-3.0, -0.5, -0.05, 0.0, 0.1, 0.5, 1.0, 2.0, 6.0})
      for (double friction : {0.0, 0.1, 0.3, 0.368, 0.6, 1.5, 5.0})
        for (double restitution : {0.0, 0.4, 1.0})
          compare(model, make_collision(0.1519, 0.1519, 5.2, tangential), {restitution, friction});
  }
}

// Losses are positive and no larger than the kinetic energy at the contact, v M_c v / 2.
RC_GTEST_PROP(CoulombLaw, DissipatesOverTheWholeBox, ()) {
  Wheel wheel = even_wheel();
  wheel.radius_of_gyration = uniform(0.005, 0.2);
  const ContactModel model = contact_model(wheel, Law::coulomb, uniform(0, 1));
  const Collision c =
      make_collision(uniform(0.05, 0.3), uniform(0.05, 0.3), uniform(0.01, 10), uniform(-3, 3), 0.1, uniform(0.3, 1.5));
  const Loss loss = coulomb_loss(model, c, {uniform(0, 1), uniform(0, 5)});
  const double r2 = model.radius_of_gyration * model.radius_of_gyration, x = c.contact_x, y = c.contact_y;
  const double vn = c.normal_speed, vt = c.tangential_speed;
  const double energy =
      model.mass / (2 * (r2 + x * x + y * y)) * ((r2 + y * y) * vn * vn - 2 * x * y * vn * vt + (r2 + x * x) * vt * vt);
  // Work is exchanged on the scale M v^2, of which the energy at the contact can be a small part.
  const double rounding = 1e-12 * model.mass * (vn * vn + vt * vt);
  RC_ASSERT(loss.normal() >= -rounding);
  RC_ASSERT(loss.tangential() >= 0);
  RC_ASSERT(loss.rebound >= 0);
  RC_ASSERT(loss.normal() + loss.tangential() <= energy + rounding);
}

TEST(CoulombLaw, ClosedFormsOfTheRollingWheel) {
  const ContactModel model = contact_model(even_wheel(), Law::coulomb);
  const Collision c = make_collision(0.1519, 0.1519, 5, 0);
  const double r2 = 0.0025, x = c.contact_x, y = c.contact_y, v2 = c.normal_speed * c.normal_speed;
  EXPECT_NEAR(coulomb_sticking_friction(model, c), 0.368, 5e-4);
  const double stick = 1.39 * (r2 + y * y) / (r2 + 0.1519 * 0.1519);
  for (double mu : {0.37, 0.5, 2.0}) {
    const Loss loss = coulomb_loss(model, c, {0.4, mu});
    EXPECT_NEAR(loss.normal(), (1 - 0.16) * stick * v2 / 2, 1e-15);
    EXPECT_EQ(loss.tangential(), 0);
  }
  for (double mu : {0.0, 0.2, 0.36}) {
    const double slip = 1.39 * r2 / (r2 + x * x - mu * x * y);
    const Loss loss = coulomb_loss(model, c, {0.4, mu});
    EXPECT_NEAR(loss.normal(), (1 - 0.16) * slip * v2 / 2, 1e-15);
    EXPECT_EQ(loss.tangential() > 0, mu > 0);
  }
}

TEST(CoulombLaw, LowestSpeedRatioOfThePapersWheel) {
  const WheelMap map(even_wheel(), 7.02 * degree, Law::coulomb, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  double lowest = 1;
  for (double eta = 0; eta <= 1; eta += 0.02)
    for (double mu = 0; mu <= 1; mu += 0.002) lowest = std::min(lowest, map.coefficients(0, {eta, mu}).scale);
  EXPECT_NEAR(lowest, 0.54, 0.005);
}

TEST(CoulombLaw, ReboundLostIsAShareOfWhatWasReleased) {
  const Collision c = make_collision(0.1519, 0.1519, 5, 0);
  const double none = coulomb_loss(contact_model(even_wheel(), Law::coulomb), c, {0.5, 0.6}).total();
  const double all = coulomb_loss(contact_model(even_wheel(), Law::coulomb, 1), c, {0.5, 0.6}).total();
  // With everything lost, a sticking collision is the plastic one.
  EXPECT_NEAR(none / all, 1 - 0.25, 1e-12);
  EXPECT_NEAR(all, coulomb_loss(contact_model(even_wheel(), Law::coulomb), c, {0, 0.6}).total(), 1e-15);
}

// Without rebound and with friction enough the foot ends at rest, whatever slip came before: the plastic loss.
TEST(CoulombLaw, IsPlasticWithoutReboundAndWithoutGyration) {
  Wheel wheel = even_wheel();
  for (double gyration : {0.05, 1e-3, 1e-6, 0.0}) {
    wheel.radius_of_gyration = gyration;
    for (double tangential : {-0.3, 0.0, 0.3}) {
      const Collision c = make_collision(0.15, 0.153, 5, tangential);
      const double plastic = plastic_loss(contact_model(wheel, Law::plastic), c).total();
      EXPECT_NEAR(coulomb_loss(contact_model(wheel, Law::coulomb), c, {0, 2}).total(), plastic, 1e-12)
          << "r_g " << gyration << " u0 " << tangential;
    }
  }
  wheel.radius_of_gyration = 0;
  EXPECT_NEAR(coulomb_loss(contact_model(wheel, Law::coulomb), make_collision(0.15, 0.15, 5, 0), {0.4, 0.2}).total(), 0,
              1e-14);
}

}  // namespace
}  // namespace metastable::dynamics::test
