#pragma once
// States what a metastability study needs: any return map with a launch. Nothing here knows a wheel.

#include <cstdint>
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
  /// Follows launch `index` of what the map stands for, with all that its states leave out, and counts the events until
  /// rest, at most `most`: the judge where map and states are said to be coarse. May be called by several threads.
  std::function<std::uint64_t(std::uint64_t seed, std::uint64_t index, std::uint64_t most)> follow = {};
};

}  // namespace metastable::analysis
