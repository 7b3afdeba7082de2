#pragma once
// Holds what several tests of dynamics/ share.

#include <rapidcheck.h>

#include <numbers>
#include <stdexcept>
#include <string>

#include "dynamics/return_map/wheel_map.h"
#include "dynamics/wheel/contact_law.h"
#include "tests/message_of.h"  // for all who include this

namespace metastable::dynamics::test {

inline constexpr double degree = std::numbers::pi / 180;

/// Returns a uniform real in [lower, upper], ends included now and then.
inline double uniform(double lower, double upper) {
  // It draws at full size: RapidCheck's ranges start small otherwise.
  const int n = *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(0, (1 << 20) + 1));
  return lower + (upper - lower) * n / (1 << 20);
}

/// Has eight equal legs of the paper's mean length.
inline Wheel even_wheel() {
  Wheel wheel;
  wheel.leg_length.assign(8, 0.1519);
  return wheel;
}

/// The paper's contact: eta and mu ~ N(0.4, 0.1^2).
inline const ContactNoise paper_noise = ContactNoise::normal(0.4, 0.1, 0.4, 0.1);

/// Returns the return map of eight equal legs.
inline WheelMap wheel_map(Law law, double slope_deg, const ContactNoise& noise, double rebound_lost = 0) {
  return WheelMap(even_wheel(), slope_deg * degree, law, noise, rebound_lost);
}

/// Makes a collision between two legs at v0 = c omega and u0.
inline Collision make_collision(double first, double second, double omega, double tangential,
                                double slope = 7.02 * degree, double angle = std::numbers::pi / 4) {
  const Triangle t = triangle(first, second, angle);
  Collision c;
  c.stance_length = first;
  c.landing_length = second;
  c.contact_x = t.contact_x;
  c.contact_y = t.hub_height;
  c.chord = t.chord;
  c.normal_speed = t.chord * omega;
  c.tangential_speed = tangential;
  c.slope_rad = slope;
  return c;
}

}  // namespace metastable::dynamics::test
