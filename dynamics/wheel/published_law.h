#pragma once
// Follows the paper's contact law, (4)-(34): T. Nanayakkara, K. Byl, H. Liu, X. Song and T. Villabona, "Dominant
// Sources of Variability in Passive Walking" (ICRA 2012).
//
// Where the print cannot be meant, it is read so: (9) with u_comp = u0 - j mu v0 m_j/n_j; (11) with mu, as (21) follows
// from it; in (28) t_r = T_r/2, and T_r in the third case; (37) with M for m; a foot that never stops slipping (zeta >=
// 1 + eta) loses energy over P_+ alone. x_cp and y_cp are distances, which gives the losses of Fig. 8. (29) and (30)
// lack 1/mu and are kept as printed. The contact's mass "m" of (25) is M. (2) with the true triangle of hub and feet,
// by which u0 = 0 for any legs. There is no rule of rest in print: stance.barrier of wheel_map.h is this library's.

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

/// Returns the losses of one collision [J], any sign of u0 (u0 < 0 mirrors the signs of the paper's j).
///
/// `jammed` when a normal mass that the collision needs is not positive: mu >= (r^2 + x^2)/(x y), about 3.2, for a
/// rolling wheel. Below mu_c = x y/(r^2 + y^2) the law returns a small negative tangential loss, as printed.
///
/// The duration T_r grows like |ln eta| as eta -> 0 (critical damping), and with it the potential energy of (33),
/// without limit. Restitutions below 2.2e-308 (the smallest normal double) are read as that: T_r = 226 sqrt(m_c/K_r) at
/// most. O(1): one logarithm, three square roots.
Loss published_loss(const ContactModel& model, const Collision& collision, const Contact& contact);

/// Returns {mu_c, (r^2 + x^2)/(x y)}; infinity where the hub is downhill of the landing foot, which then never jams.
std::vector<double> published_friction_breaks(const Collision& collision);

}  // namespace metastable::dynamics
