#pragma once
// Ranks pairs of effects: which are worth a fit, what the second effect earns beyond the first, and what bounds it.

#include <functional>
#include <vector>

#include "analysis/fitting/single_effects.h"

namespace metastable::analysis {

/// Pairs, and single effects as the pairs leave them.
struct EffectPairs {
  SingleEffects singles;  ///< with better optima that the pairs' fits came upon
  std::vector<RankedCause> pairs;
};

/// Builds pairs on the leading effects and on those asked for, each pair once.
/// @param chosen  called when they are chosen, before they are fitted
EffectPairs rank_effect_pairs(const RankingProblem& problem, SingleEffects singles, const RankingOptions& options,
                              const std::function<void()>& chosen);

}  // namespace metastable::analysis
