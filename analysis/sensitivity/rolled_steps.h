#pragma once
// Rolls wheels until they rest: expected steps and their sensitivities where a chain takes longer than the wheels.

#include <cstdint>
#include <functional>
#include <optional>

#include "analysis/sensitivity/sensitivity.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

struct RollOptions {
  std::uint64_t landings = 40000;  ///< to be rolled, >= 1: of one number of steps, and to each side of a parameter
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: all cores. Results do not depend on it
  /// It is called with the share of the work done so far, from any thread, one at a time; may throw to stop.
  std::function<void(double share)> progress = {};
};

/// Counts the steps of one wheel after another, each until it rests, until so many landings are rolled: their number
/// over that of the rests is the expected steps before failure from the launch, the wheel that is cut off included
/// (renewal theory: its bias is of the order of one rest). The interval is normal, from the scatter of the wheels that
/// rested. Nothing where fewer than 100 came to rest. Cost under `settled`: some 20 us a landing, on one thread.
/// @throws std::invalid_argument as Setting::validate()
std::optional<Estimate> rolled_steps(const Setting& setting, const RollOptions& options);

/// Finds d ln(expected steps) / d parameter by rolling the same wheels, with the same random numbers, a little to
/// either side of each parameter: means of eta and mu by a quarter of their sd, the sds by a tenth, all else by 2.5 %.
/// The error is the 95 % half-width of the paired difference; what the width of the step adds is of third order, one or
/// two per cent of the derivative. Legs are moved together. There are none, but a reason, where fewer than 100 wheels
/// come to rest. Cost: twice the landings for every parameter.
/// @throws std::invalid_argument as rolled_steps()
Sensitivities rolled_sensitivities(const Setting& setting, const RollOptions& options);

}  // namespace metastable::analysis
