#pragma once
// Holds measured collisions and where they landed: that is what the contact's likelihood is made of.

#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {

/// Holds one collision and what came of it.
struct MeasuredLanding {
  std::size_t condition = 0;  ///< index in the experiment
  int phase = 0;              ///< of the map
  double state = 0;           ///< omega_minus^2 [rad^2/s^2]
  /// The landing's x' [rad^2/s^2]; nothing where only whether it came to rest is known.
  std::optional<double> landing;
  bool rested = false;
};

/// Says whether the legs of all collisions are known, or all legs are equal.
bool legs_known(const Experiment& experiment);
/// Returns the experiment's wheel, with equal legs of the mean length where legs_known() is false.
dynamics::Wheel fitted_wheel(const Experiment& experiment);

/// Leads from each omega_minus to the next; after the last collision stands rest or survival, if it is known.
/// @param maps  one a condition; `conditions` are those wanted
std::vector<MeasuredLanding> step_landings(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                                           const std::vector<dynamics::WheelMap>& maps);
/// Leads from omega_minus to omega_plus, as the landing omega_plus would lead to; below the barrier it is a rest, where
/// only the fact counts. Collisions without omega_plus are left out.
std::vector<MeasuredLanding> collision_landings(const Experiment& experiment,
                                                const std::vector<std::size_t>& conditions,
                                                const std::vector<dynamics::WheelMap>& maps);

}  // namespace metastable::analysis
