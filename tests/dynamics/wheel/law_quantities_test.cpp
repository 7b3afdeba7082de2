#include "dynamics/wheel/law_quantities.h"

#include <gtest/gtest.h>

#include <functional>

#include "dynamics/settled/settled_motion.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics {
namespace {

// Returns omega^2 after a collision and before the next one; everything a law does to a wheel is in these.
std::pair<double, double> step(const Wheel& wheel, Law law, const Contact& contact, double rebound_lost) {
  if (law == Law::settled) {
    const Step of = SettledMotion(settled_wheel(wheel, 7.02 * test::degree)).step(1, 5, contact);
    return {of.landing.omega_plus, of.omega_minus};
  }
  const WheelMap map(wheel, 7.02 * test::degree, law, ContactNoise::normal(0.4, 0.1, 0.4, 0.1), rebound_lost);
  const double after = map.after_collision(25, 0, contact);
  return {after, after + map.stance(0).gain};
}

// Holds the table against the laws themselves: a quantity matters where changing it changes a step.
TEST(LawQuantities, AreThoseThatChangeAStep) {
  struct Case {
    LawQuantity quantity;
    std::function<void(Wheel&, Contact&, double& rebound_lost)> change;
  };
  const Case cases[] = {
      {LawQuantity::restitution, [](Wheel&, Contact& c, double&) { c.restitution = 0.2; }},
      {LawQuantity::friction, [](Wheel&, Contact& c, double&) { c.friction = 0.25; }},
      {LawQuantity::rebound_lost, [](Wheel&, Contact&, double& lost) { lost = 0.5; }},
      {LawQuantity::radius_of_gyration, [](Wheel& w, Contact&, double&) { w.radius_of_gyration = 0.07; }},
      {LawQuantity::tip_radius, [](Wheel& w, Contact&, double&) { w.tip_radius = 0.002; }},
      {LawQuantity::ramp_stiffness, [](Wheel& w, Contact&, double&) { w.ramp_stiffness = 4000; }},
      {LawQuantity::contact_mass, [](Wheel& w, Contact&, double&) { w.contact_mass = 0.7; }}};
  for (const std::string& name : law_names()) {
    const Law law = law_from_name(name);
    for (std::size_t i = 0; i < std::size(cases); ++i) {
      Wheel wheel;
      Contact contact{0.4, 0.3};
      double lost = 0;
      const auto before = step(wheel, law, contact, lost);
      // Hops are a matter of the laws that know them; others ignore the number.
      cases[i].change(wheel, contact, lost);
      EXPECT_EQ(step(wheel, law, contact, lost) != before, uses(law, cases[i].quantity)) << name << ", case " << i;
    }
  }
}

}  // namespace
}  // namespace metastable::dynamics
