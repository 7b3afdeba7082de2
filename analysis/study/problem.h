#pragma once
// States what a metastability study needs: any return map with a launch. Nothing here knows a wheel.

#include <cstdint>
#include <functional>
#include <optional>

#include "markov/transition_rows/return_map.h"
#include "markov/transition_rows/state_space.h"

namespace metastable::analysis {

/// One event that was followed.
struct FollowedEvent {
  double state = 0;                ///< before the next event
  double seconds = 0, metres = 0;  ///< from the event to the next one; 0 if unknown
};
/// Goes on by one event at every call; returns nothing once the system has come to rest.
using Run = std::function<std::optional<FollowedEvent>()>;

struct Problem {
  markov::AnyReturnMap map;
  markov::LaunchState launch;
  /// The number that is reported of a state (a wheel: omega = sqrt(x) [rad/s]).
  std::function<double(double state)> observable = [](double state) { return state; };
  /// Numbers the event whose survival means that the end of the course is reached (a ramp: its last
  /// collision).
  std::optional<int> last_event = {};
  /// Follows launch `index` of what the map stands for, with all that its states leave out, and counts the events until
  /// rest, at most `most`: the judge where map and states are said to be coarse. May be called by several threads.
  std::function<std::uint64_t(std::uint64_t seed, std::uint64_t index, std::uint64_t most)> follow = {};
  /// Follows, where there is no noise, what the map stands for from a state before the event at a phase, with all that
  /// states leave out. Not given: the map leaves nothing out.
  std::function<Run(double state, int phase)> run = {};
  /// Name what `observable` returns, in sentences.
  const char* observed = "the state";
  const char* observed_unit = "";
};

}  // namespace metastable::analysis
