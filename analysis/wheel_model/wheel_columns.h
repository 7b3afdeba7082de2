#pragma once
// Fills in columns of a wheel's experiment that were not measured.

#include <string>
#include <utility>
#include <vector>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// The noise of speeds after collisions where these are imagined and none is stated [rad/s].
inline constexpr double imagined_noise = 0.005;

/// Returns the experiment with the legs that land in turn from each condition's first; it must be of a rimless wheel.
Experiment with_legs_from_the_first(Experiment experiment);

/// Returns the experiment with each column that is missing filled in, by the column's name: legs in their turn from the
/// condition's first, speeds after collisions as values to be drawn anew. It must be of a rimless wheel.
std::vector<std::pair<std::string, Experiment>> completed_experiments(const Experiment& experiment);

}  // namespace metastable::analysis
