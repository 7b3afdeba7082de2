#pragma once
// Finds legs that are noted, or whose lengths are stated, in another order than the stances show.

#include <optional>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Returns a question, which ends in '?', where stances fit the stated lengths far better with all legs turned on by
/// some, or listed the other way round, or where those of at most half of the trials do with other legs. Where a column
/// is one leg off, the effect leg_lengths closes the whole gap, and nothing is wrong with the wheel.
/// It returns nothing for legs of one length, under `settled`, without omega+, and for more than 32 legs. O(legs
/// collisions).
/// @param measured  with the legs of the column @param experiment  whose trials these are, for their numbers
std::optional<std::string> question_on_leg_order(const WheelRuns& measured, const Experiment& experiment);

}  // namespace metastable::analysis
