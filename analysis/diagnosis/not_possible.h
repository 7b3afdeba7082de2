#pragma once
// Lists statements for which an experiment has too few trials, collisions or rests, and how many would do.

#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// Counts the trials that the held-out measures need: two a fold.
inline std::size_t trials_for_folds(int folds) { return 2 * static_cast<std::size_t>(folds); }

/// Says how many trials like these would do to put a gap down to a cause; nothing: these do.
std::optional<std::size_t> trials_to_explain(const Diagnosis::Data& data);

/// @param d  complete but for `not_possible`
std::vector<NotPossible> not_possible(const TransitionModel& model, const Diagnosis& d,
                                      const DiagnosisOptions& options);

}  // namespace metastable::analysis
