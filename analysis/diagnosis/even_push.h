#pragma once
// Says whether what was found is more than an even push of the measured values.

#include <string>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Returns a sentence where a push of every measured value by the same amount at every step fits as well as the
/// hypothesis does: what has no place in the catalogue and pushes so would be given the same name. Returns "" where the
/// hypothesis gains more by Rules::told_apart, and for systems without TransitionModel::even_push().
std::string even_push_in_words(const TransitionModel& model, const Fit& recalibrated, const RankedCause& best,
                               const Rules& rules, int threads);

/// Returns a sentence that a variation without a name is all that the data show of the effect that is named.
/// @param same  same_variation()
std::string same_push_in_words(const Variation& same);

}  // namespace metastable::analysis
