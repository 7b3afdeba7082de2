#pragma once
// The walkers as machines whose walks are diagnosed: their step with what real ones have and the ideal ones lack.

#include <optional>

#include "analysis/machine_model/machine.h"
#include "analysis/walkers/walker_study.h"

namespace metastable::analysis {

/// Says what is known of a walker that was measured.
struct WalkerStatement {
  WalkerSetting setting;                           ///< terrain fresh
  double slope_known_deg = 0.1;                    ///< sd with which the mean slope is known [deg], >= 0
  std::optional<double> roughness_known_deg = {};  ///< the same of the slope's sd [deg]; nothing: as large as that sd
  bool legs = false;                               ///< it is known which leg stands: input "stance_leg", 1 or 2
};

/// Returns the walker as a machine. States: half_angle_rad, stance_rate_rad_s and, of the compass, swing_rate_rad_s, of
/// which none is observed yet; the score is the slope's. Parameters: slope_deg (it may vary) and slope_sd_deg.
/// Effects, with their parameters:
///   hip_damping       damping [N m s/rad] of the hip
///   hip_dry_friction  torque [N m] of the hip, of constant size
///   impact_loss       share of the energy that a strike takes beyond the plastic one
///   foot_slip         slip [m] of the struck foot as it is loaded
///   leg_mass          of leg 1: mass_ratio, and higher [m], by which its mass sits nearer to the hip
///   leg_length        of leg 1: longer [m], by which it reaches further below its mass
/// The last two are the compass's where it is known which leg stands. Of the simplest walker damping and torque are
/// those on the swing leg over its inertia, [sqrt(g/l)] and [g/l], and slip is in legs.
/// @throws std::invalid_argument for a setting out of range, and for terrain that remembers
Machine walker_machine(const WalkerStatement& statement);

}  // namespace metastable::analysis
