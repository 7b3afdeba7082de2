#pragma once
// Says of one collision what the landing foot's impulse takes out of the motion.

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/wheel/contact_noise.h"
#include "dynamics/wheel/wheel.h"

namespace metastable::dynamics {

enum class Law { published, coulomb, plastic, settled };

/// Takes "published", "coulomb", "plastic", "settled". @throws std::invalid_argument naming the four.
Law law_from_name(std::string_view name);
std::string_view law_name(Law law);
std::vector<std::string> law_names();

/// Holds what a law needs to know of one collision's geometry, in SI units; speeds are those just before the collision.
struct Collision {
  double stance_length = 0;   ///< L1 [m]
  double landing_length = 0;  ///< L2 [m]
  double contact_x = 0;       ///< x_cp [m], of the hub uphill of the foot
  double contact_y = 0;       ///< y_cp = h [m]
  double chord = 0;           ///< c [m]
  double normal_speed = 0;    ///< v0 = c omega [m/s], approach speed of the foot, > 0
  double tangential_speed =
      0;                 ///< u0 [m/s], > 0: the foot slides UPHILL (the paper's positive sense); 0 for a rolling wheel
  double slope_rad = 0;  ///< gamma
};

/// Holds the energies of one collision [J]; each may be read on its own, total() is what the return map takes off.
struct Loss {
  double normal_pre = 0, normal_post = 0;          ///< D_n before and after slip stops (13), (19)
  double tangential_pre = 0, tangential_post = 0;  ///< D_t (16), (21)
  double potential = 0;      ///< eps_pot (33): M g S sin(gamma), S uphill positive, `published`; downhill, `settled`
  double rebound = 0;        ///< share of the rebound's energy lost in later hops; `coulomb` only
  double zeta = 0, tau = 0;  ///< shares of the impulse, `published` only
  double slip_distance = 0;  ///< S [m] (32), uphill positive; `published` and `settled`
  bool jammed = false;       ///< the foot digs in and the wheel stops; the energies then cover only what went before
  double normal() const { return normal_pre + normal_post; }                      ///< eps_n (23)
  double tangential() const { return tangential_pre + tangential_post; }          ///< eps_t (22)
  double total() const { return normal() + tangential() + rebound - potential; }  ///< eps (34)
};

/// Holds the physical constants a law takes from the wheel, resolved once (defaults filled in per law).
struct ContactModel {
  Law law = Law::published;
  double mass = 0;  ///< M [kg]
  double radius_of_gyration =
      0;  ///< r_g [m] about the hub: coulomb and settled default 0.05, plastic default 0; published uses r = L2 instead
  double ramp_stiffness = 0;  ///< K_r [N/m], published
  double contact_mass = 0;    ///< m_c [kg], published
  double gravity = 0;         ///< g [m/s^2]
  double rebound_lost = 0;    ///< in [0, 1], coulomb
};
/// A wheel whose inertia is given but not its radius of gyration gets the r_g that belongs to it in every law but
/// `published`: r_g^2 = I/M - (mean L)^2.
/// @throws std::invalid_argument for rebound_lost outside [0, 1], or an inertia below M (mean L)^2 in that case
ContactModel contact_model(const Wheel& wheel, Law law, double rebound_lost = 0);

/// Returns the energy lost in one collision under the model's law.
///   published: the paper's (4)-(34) as published_law.h reads them, any sign of u0
///   coulomb:   planar stick-slip with energetic restitution (Stronge 1990), any sign of u0, slip stop and reversal
///   plastic:   no slip, no rebound (McGeer 1990); the loss is that of the angular momentum balance about the foot
/// O(1).
/// @throws std::logic_error under `settled`, whose landing is a motion of its own (dynamics/settled)
Loss collide(const ContactModel& model, const Collision& collision, const Contact& contact);

/// Returns, ascending, the frictions at which the loss of a rolling wheel's collision (u0 = 0) changes its form in mu.
/// Between them it is smooth; beyond the last one (everywhere, if there is none) it is constant or the foot jams.
std::vector<double> friction_breaks(const ContactModel& model, const Collision& collision);

/// Returns the inertia about the stance foot of leg length L [kg m^2].
///   published: wheel.inertia, default M (mean L)^2, the same for every leg
///   others: M (r_g^2 + L^2); a given wheel.inertia is read as that of the mean leg and shifted by M (L^2 -
///   mean L^2)
double stance_inertia(const Wheel& wheel, Law law, double length);

}  // namespace metastable::dynamics
