#pragma once
// Says whether the walker can come to rest at all, decided on the map's support, not on samples.

#include <optional>

#include "analysis/study/problem.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

struct RestReachability {
  /// It is false where some launches never come to rest, whatever the noise does: expected steps are infinite.
  bool certain = true;
  /// The lowest state at the launch phase from which no sequence of noise leads to rest; nothing if there is none.
  std::optional<double> safe_state;
};

/// Follows the worst landing (infimum over the noise's support) from a state: if it settles above rest, the state is
/// safe. The safe threshold is found by bisection to a relative 1e-10; rest is uncertain when the launch, or its best
/// landings, can get there. Maps that do not tell their landing range count as "rest is certain".
/// Assumes that landings rise with the state.
RestReachability rest_reachability(const Problem& problem);

/// Finds the slope [deg] above which the setting's wheel has safe states (rest becomes unreachable from fast enough
/// launches), by bisection to 1e-6 deg; nothing if there are none at any slope below alpha/2. The ramp's slope in
/// `setting` is ignored.
std::optional<double> safe_slope_deg(const Setting& setting);

}  // namespace metastable::analysis
