#pragma once
// Says how the speed runs on from collision to collision, measured and simulated.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

struct Fit;

/// Holds mean speed before each collision, measured and simulated; of a model with several columns the mean of each.
struct ProfilePoint {
  std::size_t column = 0;
  std::size_t condition = 0;
  int collision = 1;
  std::size_t trials = 0;
  double measured = 0, measured_error = 0;  ///< mean, standard error [rad/s]
  /// Simulated means, and the half-width of the 95 % band of the mean of as many trials [rad/s]; NaN: none came so far.
  double baseline = std::numeric_limits<double>::quiet_NaN(), with_effect = baseline, band = baseline;
};

/// Returns the mean speed before each collision by condition and column, up to the 40th, where three trials or more
/// have one. The means of the nominal and of the chosen model are taken over four simulated experiments each.
std::vector<ProfilePoint> collision_profile(const TransitionModel& model, const std::vector<double>& nominal,
                                            const Fit& chosen, std::uint64_t seed);

}  // namespace metastable::analysis
