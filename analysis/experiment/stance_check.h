#pragma once
// Holds measured stances against what gravity gives them: a column that stands a row off, speeds in another scale,
// clocks that jump and collisions that nobody noted show, whatever the contacts do.

#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"

namespace metastable::analysis {

/// Reports, one line each, a column omega_plus_rad_s whose values belong to the row before or behind, and stances that
/// gain so much more energy than gravity gives a wheel on this ramp that speeds must be in another scale. It reports
/// nothing where fewer than 20 stances have a speed at both ends. O(collisions).
/// @param experiment  of a rimless wheel
void check_stances(const Experiment& experiment, const std::string& file, Defects& defects);

/// Returns what stances leave in doubt, a question each that ends in '?': more energy than gravity gives; a scale of
/// speeds, or of times, that the other contradicts by more than 3 %; single stances that last too long, and single
/// steps that are too long, as where a collision is missing. O(collisions).
/// @param experiment  of a rimless wheel
std::vector<std::string> questions_on_stances(const Experiment& experiment);

}  // namespace metastable::analysis
