#pragma once
// Asks of each effect whether it is at work beside something without a name, or only takes its shape.

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {

/// Fits the model's variation that says most beside a hypothesis, or most by itself, together with the hypothesis, and
/// both again without each of its effects. Returns by effect the probability that it is at work, given that variation:
/// the odds of what it gains there. An effect that takes the variation's shape gains nothing beside it.
/// Empty where the model has no variations or trials do not suffice to tell them.
/// @param alone  what varies at the recalibrated model, by facet (fitted_variations())
std::map<std::string, double> probabilities_beside_unnamed(const TransitionModel& model, const CauseRanking& ranking,
                                                           const RankedCause& best, const Fit& recalibrated,
                                                           const std::vector<LeftInFacet>& alone,
                                                           std::size_t candidates, const DiagnosisOptions& options,
                                                           const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
