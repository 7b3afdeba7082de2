#pragma once
// Turns the paper's hypotheses into variance shares: launch speed, leg lengths, restitution and friction.

#include <array>
#include <cstddef>

#include "analysis/statistics/sobol_indices.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Names the groups of a SobolResult, in order.
enum class VarianceSource { launch_speed, leg_lengths, restitution, friction };
constexpr std::array<const char*, 4> variance_sources = {"launch speed", "leg lengths", "restitution", "friction"};
/// Returns the indices of one source. @param result  of an output that varies
inline const SobolIndex& index_of(const SobolResult& result, VarianceSource source) {
  return result.group.at(static_cast<std::size_t>(source));
}

struct VarianceSources {
  /// The mean speed before collisions 13 to 16 [rad/s], where nothing rests and x' < 0 is set to 0. Under `settled`
  /// a wheel that rests goes on as slowly as one just past the barrier.
  SobolResult steady_speed;
  SobolResult steps;  ///< steps before failure, at most those on the ramp; first order: of the expected steps
};

/// Simulates trials of `setting` with every source random: launch as set; each leg N(mean, sd^2); eta and mu of every
/// collision, independent (a list of pairs or a correlation is refused: std::invalid_argument).
/// @param leg_sd  sd of a leg's length [m] about the setting's mean; the paper's legs: 0.000687
VarianceSources variance_of_trials(const Setting& setting, double leg_sd, const SobolOptions& options);

}  // namespace metastable::analysis
