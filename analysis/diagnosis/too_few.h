#pragma once
// Lists statements for which an experiment has too few trials, collisions or rests, and how many would do.

#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// Counts the trials that the held-out measures need: two a fold.
inline std::size_t trials_for_folds(int folds) { return 2 * static_cast<std::size_t>(folds); }

/// Are the trials, and transitions of a speed in all of them, from which a gap is put down to a cause: contact
/// parameters, an effect of the catalogue, or something without a name. Below, the fits have as many parameters as there
/// is to see, and whatever bends most passes for the cause.
inline constexpr std::size_t least_trials_to_explain = 4, least_transitions_to_explain = 40;

/// Says how many trials like these would do to put a gap down to a cause; nothing: these do.
std::optional<std::size_t> trials_to_explain(const Diagnosis& d);

/// @param d  complete but for `not_possible`
std::vector<NotPossible> too_few(const TransitionModel& model, const Diagnosis& d, const DiagnosisOptions& options);

}  // namespace metastable::analysis
