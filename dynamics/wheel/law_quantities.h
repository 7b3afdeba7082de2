#pragma once
// Says which quantities each contact law uses; the others have no meaning under it.

#include <span>
#include <string_view>

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

enum class LawQuantity {
  restitution,         ///< eta
  friction,            ///< mu
  rebound_lost,        ///< share of the rebound's energy lost in hops
  radius_of_gyration,  ///< r_g
  tip_radius,          ///< r
  ramp_stiffness,      ///< K_r
  contact_mass         ///< m_c
};

/// Returns the laws that use it, in the order of law_names().
std::span<const Law> laws_with(LawQuantity quantity);
bool uses(Law law, LawQuantity quantity);

}  // namespace metastable::dynamics
