#pragma once
// Lists the numbers of a setting that may be varied one at a time.

#include <string_view>

#include "analysis/study/setting.h"

namespace metastable::analysis {

enum class Parameter {
  slope,             ///< gamma [deg]
  restitution_mean,  ///< of eta, before truncation
  restitution_sd,
  friction_mean,  ///< of mu, before truncation
  friction_sd,
  leg_length,          ///< mean of the legs [m]; varied, all legs keep their proportions
  inertia,             ///< about the foot of a leg of mean length [kg m^2]; varied, the contact law keeps its r_g;
                       ///< not under `settled`, whose r_g is its inertia
  ramp_stiffness,      ///< K_r [N/m], `published` only
  radius_of_gyration,  ///< r_g [m], not under `published`; an inertia that is not given follows it
  contact_mass,        ///< m_c [kg], `published` only
  tip_radius,          ///< r [m], `settled` only
};

/// Takes "slope", "restitution-mean", ... @throws std::invalid_argument naming them all
Parameter parameter_from_name(std::string_view name);
std::string_view parameter_name(Parameter parameter);
std::string_view parameter_unit(Parameter parameter);   ///< "deg", "m", ...; "1" for pure numbers
std::string_view parameter_label(Parameter parameter);  ///< for axes: "slope γ", "sd of friction μ", ...

/// Returns its value in a setting, defaults that follow from other quantities filled in.
double parameter_value(const Setting& setting, Parameter parameter);
/// Gives it another value; all that is not given and depends on it follows. Ranges are checked by Setting::problem().
void set_parameter(Setting& setting, Parameter parameter, double value);
/// Does the setting's return map depend on it? A list of contacts has no means and spreads, a constant no spread, and
/// each law its own constants.
bool matters(const Setting& setting, Parameter parameter);

}  // namespace metastable::analysis
