#pragma once
// The paper's contact law, (4)-(34), with the readings of physics ("published").

#include "dynamics/contact_law.h"

namespace metastable::dynamics {

/// Losses of one collision [J]; any sign of u0 (u0 < 0 mirrors the signs of the paper's j).
///
/// `jammed` when a normal mass that the collision needs is not positive: mu >= (r^2 + x^2)/(x y), about 3.2, for a
/// rolling wheel. Below mu_c = x y/(r^2 + y^2) the law returns a small negative tangential loss, as printed.
///
/// The duration T_r grows like |ln eta| as eta -> 0 (critical damping), and with it the potential energy of (33),
/// without limit. Restitutions below 2.2e-308 (the smallest normal double) are read as that: T_r = 226 sqrt(m_c/K_r) at
/// most. O(1): one logarithm, three square roots.
Loss published_loss(const ContactModel& model, const Collision& collision, const Contact& contact);

/// {mu_c, (r^2 + x^2)/(x y)}; infinity where the hub is downhill of the landing foot, which then never jams.
std::vector<double> published_friction_breaks(const Collision& collision);

}  // namespace metastable::dynamics
