#pragma once
// Says what a laboratory's effects change, as plain numbers: the catalogue's ids are read in one place.

#include <vector>

#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/laboratory/outside_effect.h"

namespace metastable::dynamics {

struct LegChange {
  int leg = 0;
  double friction_ratio = 1, restitution_ratio = 1;
};
struct PatchChange {
  double from = 0, to = 0;  ///< [m]; to = 0: the ramp's end
  double friction_ratio = 1;
};

/// All is neutral unless said otherwise; the symbols are those of the catalogue's `meaning`.
struct LaboratoryChanges {
  NominalValues stated;  ///< contact distribution and leg lengths, effects included
  double launch_mean = 0, launch_sd = 0;
  std::vector<LegChange> legs;
  std::vector<PatchChange> patches;
  double mass_offset = 0, mass_angle_rad = 0;
  double inertia_ratio = 1;
  double slope_offset_deg = 0;
  double sag = 0, sag_from = 0, sag_to = 0;
  double linear_drag = 0, constant_drag = 0, quadratic_drag = 0;
  double restitution_exponent = 0;
  double stribeck_amplitude = 0, stribeck_speed = 5;
  double memory = 0;
  double drift = 0;
  double trial_sd = 0;
  double outlier_share = 0, outlier_ratio = 1;
  double sensor_noise = 0, sensor_bias = 0;
  double rebound_lost = 0;
  double hops_from = 0;   // omega- [rad/s]
  double compliance = 0;  // of tips [m/N]
  double vibration = 0, vibration_hz = 10;
  bool slip_reversal = false;
  // These are outside the catalogue.
  double slosh = 0, stored = 0, second_memory = 0, wind = 0;
  std::vector<OutsideEffect> of_contact;  // those with an OutsideInfo::change
};

/// @throws std::invalid_argument for an unknown id, a wrong number of values, a size out of range, or an id given twice
///         (leg_contact and friction_patch may be)
LaboratoryChanges laboratory_changes(const NominalValues& stated, const std::vector<Effect>& effects,
                                     const std::vector<OutsideEffect>& outside);

}  // namespace metastable::dynamics
