#include "dynamics/wheel/plastic_law.h"

namespace metastable::dynamics {

Loss plastic_loss(const ContactModel& model, const Collision& c) {
  const double r2 = model.radius_of_gyration * model.radius_of_gyration;
  const double x = c.contact_x, y = c.contact_y, v0 = c.normal_speed, u0 = c.tangential_speed;
  // The impulse M_c v that stops the contact point does the work v M_c v / 2, with the contact's mass matrix
  // M_c = M/(r^2+x^2+y^2) [[r^2+y^2, -x y], [-x y, r^2+x^2]] (normal, downhill).
  const double mass = model.mass / (r2 + x * x + y * y);
  Loss loss;
  loss.normal_post = mass * v0 * ((r2 + y * y) * v0 - x * y * u0) / 2;
  loss.tangential_post = mass * u0 * ((r2 + x * x) * u0 - x * y * v0) / 2;
  // L1 L2 cos(alpha) comes from the triangle: c^2 = L1^2 + L2^2 - 2 L1 L2 cos(alpha).
  const double l1 = c.stance_length, l2 = c.landing_length;
  loss.jammed = (l1 * l1 + l2 * l2 - c.chord * c.chord) / 2 + r2 < 0;
  return loss;
}

}  // namespace metastable::dynamics
