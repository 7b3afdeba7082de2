#pragma once
// Solves the planar stick-slip collision with energetic restitution (Stronge 1990).

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

/// Returns the losses of one collision [J], any sign of u0, integrated in closed form over the normal impulse P.
///
/// Contact velocities obey dv_n = [(r^2+x^2) dP + x y dP_t]/(M r^2), dv_t = [(r^2+y^2) dP_t + x y dP]/(M r^2), with
/// v_t and P_t downhill and r the radius of gyration about the hub. While the foot slips, |P_t| = mu P against the
/// slip. When slip stops it sticks if mu >= mu_c = |x y|/(r^2+y^2), else it slips the way the coupling x y drives it.
/// The normal speed may grow while the foot digs in (uphill coupling with large mu) until slip stops. Compression ends
/// at v_n = 0; restitution ends when eta^2 of the absorbed normal work is released.
///
/// `rebound` is model.rebound_lost times the released work. The total is >= 0 for every eta in [0, 1], mu >= 0.
/// r_g -> 0 is taken as the limit: r_g is read as at least 1e-8 of the foot's distance from the hub. O(1).
Loss coulomb_loss(const ContactModel& model, const Collision& collision, const Contact& contact);

/// Returns r_g^2 [m^2] as the law reads it.
double coulomb_squared_gyration(const ContactModel& model, const Collision& collision);

/// Returns mu_c, from which on the foot of a rolling wheel sticks.
double coulomb_sticking_friction(const ContactModel& model, const Collision& collision);

}  // namespace metastable::dynamics
