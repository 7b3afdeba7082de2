#pragma once
// Holds what was read of trials against what the wheel can do: units that are not those of the column show, and trials
// that are there twice.

#include <cstddef>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"

namespace metastable::analysis {

/// Holds the line of each collision in its file, by trial.
using CollisionLines = std::vector<std::vector<std::size_t>>;

/// Reports a folder in which most collisions leave more speed than they found, with the suspicion that two columns are
/// exchanged or in two units; speeds no wheel of these legs rolls at (rolling_speeds()); single collisions that gain
/// more than legs of unequal lengths and errors of speeds can do; times in which a wheel would turn by far more or far
/// less than a leg angle from collision to collision at its speeds; steps of positions far from the distance between
/// its feet, and positions beyond the ramp's end. One line each, with the first place and the unit that is suspected.
/// @param experiment  of a rimless wheel, trials as they stand in the file
void check_plausible(const Experiment& experiment, const std::string& file, const CollisionLines& lines,
                     Defects& defects);

/// Reports trials whose speeds are those of another one, all of them and to their last digit, where chance would hardly
/// make one such pair.
void check_copies(const Experiment& experiment, const std::string& file, const CollisionLines& lines, Defects& defects);

}  // namespace metastable::analysis
