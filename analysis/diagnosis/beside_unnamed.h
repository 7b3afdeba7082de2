#pragma once
// Asks of each effect whether it is at work beside something without a name, or only takes its shape.

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/fits_without.h"
#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {

/// A variation without a name that is there rather than what a hypothesis names.
struct InPlace {
  std::size_t variation = 0;  ///< of TransitionModel::variations()
  double gain = 0;            ///< 2 Delta log likelihood, where it stands
  double odds = 0;            ///< of it in the place of one effect, to the hypothesis
};

/// Returns the variation that says most of all that may act alone, more than any facet of the map; nothing where a
/// facet says more. Its odds are not asked.
/// @param alone  what varies at the recalibrated model, and what that leaves, by facet
std::optional<InPlace> varies_without_name(const TransitionModel& model, const std::vector<LeftInFacet>& alone);

/// Returns the variation that says most of all that may act alone, where it is what the hypothesis names: that is one
/// effect of Variation::named and gains as much, up to Rules::told_apart, and no facet of the map says clearly more.
/// Else nullptr.
const Variation* same_variation(const TransitionModel& model, const RankedCause& best,
                                const std::vector<LeftInFacet>& alone, const Rules& rules);

/// Finds the variation that fits best in the place of one effect of a hypothesis of several, the others kept. Of one
/// effect the variations at the recalibrated model say so. Nothing where none is clearly likelier than the
/// effect, by 1 / Rules::most_odds_of_none(), or than that effect and others that say nothing beside the variation.
/// @param without  fits of the hypothesis without each effect  @param facets  in how many something may act
std::optional<InPlace> in_place_of_effects(const TransitionModel& model, const CauseRanking& ranking,
                                           const RankedCause& best, const Fit& recalibrated, FitsWithout& without,
                                           std::size_t facets, const DiagnosisOptions& options,
                                           const std::function<void()>& heartbeat);

/// Fits the model's variation that says most beside a hypothesis, or most by itself, together with the hypothesis, and
/// both again without each of its effects. Returns by effect the probability that it is at work, given that variation:
/// the odds of what it gains there. An effect that takes the variation's shape gains nothing beside it.
/// Empty where the model has no variations or trials do not suffice to tell them.
/// @param alone  what varies at the recalibrated model, by facet (fitted_variations())
/// @param there  the variation that is there, whatever is beside it: no other one is asked, and what an error of its
/// form leaves (Rules::variation_error) counts for no effect; and effects that bend one another beside it fall one by
/// one, the one that gains least first, until those left are at work; nothing: it is not known
std::map<std::string, double> probabilities_beside_unnamed(const TransitionModel& model, const CauseRanking& ranking,
                                                           const RankedCause& best, const Fit& recalibrated,
                                                           const std::vector<LeftInFacet>& alone,
                                                           const std::optional<InPlace>& there, std::size_t candidates,
                                                           const DiagnosisOptions& options,
                                                           const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
