#pragma once
// Fits one more effect to what is there: which of its variants, from where, and between them.

#include <cstddef>

#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/model_fit.h"

namespace metastable::analysis {

/// Says how much is fitted. Experiments that are large, or far off their model, would take many minutes at full effort.
struct Effort {
  double least_promise = 2;       ///< gain by the scores, for a fit
  std::size_t most_variants = 3;  ///< of one effect that are fitted
  std::size_t most_leaders = 3;   ///< single effects that are refined, and that pairs are built on if not far behind
  std::size_t most_partners = 3;  ///< of one leader that are fitted
  int refinements = 3;            ///< of a variant, each with half the moves
  int most_iterations = FitOptions{}.most_iterations;
  std::size_t most_effects = 6;  ///< of one hypothesis
};
Effort effort_for(const TransitionModel& model, const Fit& recalibrated);

/// Returns a variant of the effect at the size that its scores promise, no further than they are good for.
EffectTerm term_at(const ScannedEffect& scanned, std::size_t variant);

/// Finds the best fit of `base` with one more effect, as its last term.
/// @param scanned  beside `base`
/// @param gain_alone  its likelihood is all that is asked for: a step that rises about as it foretold is the last
Fit fit_one_more(const TransitionModel& model, const Effort& effort, const Fit& base, const ScannedEffect& scanned,
                 bool gain_alone = false);

/// Moves the last term's variant between the list's values as long as the likelihood rises, halving the moves.
void refine_variant(const TransitionModel& model, const Effort& effort, Fit& best);

}  // namespace metastable::analysis
