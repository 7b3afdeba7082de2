#pragma once
// States what a metastability study needs: any return map with a launch. Nothing here knows a wheel.

#include <functional>
#include <optional>

#include "markov/rows/return_map.h"
#include "markov/rows/state_space.h"

namespace metastable::analysis {

struct Problem {
  markov::AnyReturnMap map;
  markov::LaunchState launch;
  /// Is what is reported of a state (a wheel: omega = sqrt(x) [rad/s]).
  std::function<double(double state)> observable = [](double state) { return state; };
  /// Numbers the event whose survival means that the end of the course is reached (a ramp: its last
  /// collision).
  std::optional<int> last_event = {};
};

}  // namespace metastable::analysis
