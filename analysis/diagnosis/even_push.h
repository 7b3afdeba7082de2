#pragma once
// Says whether what was found is more than an even push of the measured values.

#include <optional>
#include <string>
#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Holds a push of every measured value by the same amount at every step, as it fits best, and how it stands to a
/// hypothesis.
struct EvenPush {
  std::vector<double> by;        ///< of each of TransitionModel::columns()
  double gain = 0, of_best = 0;  ///< 2 Delta log likelihood over the recalibrated model, of the push and the hypothesis
  double log_odds = 0;           ///< of the push over the hypothesis, by their evidence alone
  /// Says whether the push gains so much more, and is so much likelier, that the hypothesis must not get its name. A
  /// hypothesis of more parameters that gains as much is no worse than the push.
  bool instead(const Rules& rules) const {
    return gain > of_best + rules.told_apart && 2 * log_odds > rules.told_apart;
  }
};

/// Fits the push; nothing for systems without TransitionModel::even_push(), and for a hypothesis that was not fitted.
std::optional<EvenPush> fitted_even_push(const TransitionModel& model, const Fit& recalibrated, const RankedCause& best,
                                         const Rules& rules, int threads);

/// Returns a sentence where the push fits as well as the hypothesis does, or better: what has no place in the catalogue
/// and pushes so would be given the same name. Returns "" where the hypothesis gains more by Rules::told_apart.
std::string even_push_in_words(const TransitionModel& model, const EvenPush& push, const Rules& rules);

/// Returns a sentence that a variation without a name is all that the data show of the effect that is named.
/// @param same  same_variation()
std::string same_push_in_words(const Variation& same);

}  // namespace metastable::analysis
