#pragma once
// Finds legs that are noted, or whose lengths are stated, in another order than the stances show, and speeds that stand
// a row off.

#include <optional>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Returns a question, which ends in '?', where stances fit the stated lengths far better with all legs turned on by
/// some, or listed the other way round, or where those of at most half of the trials do with other legs. Where a column
/// is one leg off, the effect leg_lengths closes the whole gap, and nothing is wrong with the wheel.
/// Under `settled` a stance is what the next speed says beside the speeds around a collision. It returns nothing for
/// legs of one length, without omega+, and for more than 32 legs. O(legs collisions).
/// @param measured  with the legs of the column @param experiment  whose trials these are, for their numbers
std::optional<std::string> question_on_leg_order(const WheelRuns& measured, const Experiment& experiment);

/// Returns a question, which ends in '?', where under `settled` next speeds fit far better beside the omega+ of the row
/// before or behind. Under other laws check_stances() refuses such columns. O(collisions).
std::optional<std::string> question_on_rows(const WheelRuns& measured);

}  // namespace metastable::analysis
