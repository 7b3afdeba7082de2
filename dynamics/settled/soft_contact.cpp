#include "dynamics/settled/soft_contact.h"

#include <algorithm>
#include <cmath>

#include "dynamics/numerics/square.h"

namespace metastable::dynamics {
namespace {

constexpr double least_restitution = 0.01, most_restitution = 0.95;

// Returns the duration of an impact: the force of an oscillator whose damping is sin(phi) vanishes at
// (pi - 2 phi) / cos(phi), of one whose damping is cosh(chi) at 2 chi / sinh(chi).
double duration(double damping) {
  const double off = 1 - damping * damping;
  if (std::abs(off) < 1e-8) return 2;
  const double root = std::sqrt(std::abs(off));
  return off > 0 ? 2 * std::acos(damping) / root : 2 * std::acosh(damping) / root;
}

}  // namespace

SpringImpact::SpringImpact(double restitution) {
  const double eta = std::clamp(restitution, least_restitution, most_restitution);
  // The speed at the end is exp(-damping duration), which falls with the damping.
  double low = 0, high = 10;
  for (int i = 0; i < 60; ++i) {
    damping = (low + high) / 2;
    (damping * duration(damping) < -std::log(eta) ? low : high) = damping;
  }
  lasts = duration(damping);
  depth = 2 * damping * eta;
  weighted = eta * (lasts + 2 * damping) / (1 + eta);
  run = (lasts - depth) / (1 + eta);
  const double squared_speed = (1 - square(eta) - square(depth)) / (4 * damping);  // integrated: the balance of energy
  run_twice = (lasts - 2 * depth + squared_speed) / square(1 + eta);
}

void SoftContact::soften(SettledLanding& landing, const Load& load) const {
  if (softness_ == 0) return;
  const double d = landing.ahead, h = landing.height, k2 = landing.gyration_sq, omega = landing.omega;
  const double mass = load.mass / (1 + square(d) / (k2 + square(h)));  // that a foot meets which sticks
  const double unit = softness_ * std::sqrt(mass);                     // of time [s]
  const double lost = (1 + restitution_) * landing.chord * d / (k2 + square(d) + square(h));
  const double squared = square(omega) * (spring_.lasts - lost * (2 * spring_.run - lost * spring_.run_twice));
  const double acts = spring_.lasts - spring_.depth;  // a steady pull presses longer, and less comes back of it
  const double pull = load.gravity * std::cos(load.slope) * acts - h * squared * acts / spring_.lasts;
  landing.turned = unit * omega * (spring_.weighted - lost * (spring_.run - spring_.run_twice));
  landing.pressed = 1 + unit * pull / ((1 + restitution_) * landing.chord * omega);
  const double pushed = (1 + restitution_) * landing.pressed * landing.chord * omega * mass / load.mass;
  landing.sticking_shift =
      unit * (load.gravity * std::sin(load.slope) * spring_.lasts - d * squared) * k2 / ((k2 + square(h)) * pushed);
}

}  // namespace metastable::dynamics
