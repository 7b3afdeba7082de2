#pragma once
// Finds which effect it is: every candidate is fitted, weighed and compared with chance, several at once where they
// earn it.

#include <functional>
#include <string>
#include <vector>

#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"

namespace metastable::analysis {

/// A hypothesis supposes one effect or several.
struct RankedCause {
  std::vector<EffectTerm> terms;
  Fit fit;
  double gain = 0;  ///< 2 Delta penalised log likelihood over the recalibrated model
  /// The probability of the gain by chance: of a single effect by the variants listed, before one between them was
  /// sought; of several that of what the last one earned beyond the others.
  double p_value = 1;
  double evidence = 0;  ///< log Bayes factor against the recalibrated model, prior odds of several effects included
  /// The gain of several effects over the sum of what they gain alone, where that sum counts what each hides of the
  /// others by its scatter; 1 for one effect.
  double together = 1;
  std::string not_decided;  ///< why, where the data cannot tell or the fit did not converge
  bool candidate_undecided() const { return !terms[0].candidate->undecidable.empty(); }
  bool fitted() const { return !fit.nuisance.empty(); }
  /// Takes a better fit of the same effects: the likelihoods of their other variants, and so the prior, stay what they
  /// were.
  void take(Fit better, const Fit& recalibrated);
};

/// Returns a fit as a hypothesis that has its gain and is not weighed yet; its evidence is -infinity where the gain is
/// not finite.
RankedCause as_cause(Fit fit, const Fit& recalibrated);

struct CauseRanking {
  EffectScan scan;                   ///< at the recalibrated model
  std::vector<RankedCause> singles;  ///< every candidate, in the order of the catalogue
  std::vector<RankedCause> pairs;
  std::vector<RankedCause> sets;  ///< of three effects and more
  double p_value = 1;             ///< of the best single effect among those listed, with the look elsewhere
};

struct RankingOptions {
  int threads = 0;
  int draws = 2000;
  std::uint64_t seed = 1;
  Rules rules = {};
  std::vector<std::pair<const Candidate*, const Candidate*>> pairs = {};  ///< tried in any case
  std::function<void(double)> progress;  ///< share done; called from any thread, one at a time; may throw to stop
};

/// Weighs hypotheses by their evidence (bayes_factor.h); each further effect counts for what it earned. Candidates
/// whose scores promise less than a fifth of a large best gain are not fitted.
/// @param candidates  to be considered
CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options);

/// Says whether `terms` hold all effects of `others`.
bool extends(const std::vector<EffectTerm>& terms, const std::vector<EffectTerm>& others);

/// Returns the fit beyond which what `terms` gained may be off by an error of form: that of those of them that are
/// exact, or `recalibrated`. @param singles  fitted causes
const Fit& exact_part(const std::vector<RankedCause>& singles, const std::vector<EffectTerm>& terms,
                      const Fit& recalibrated);

}  // namespace metastable::analysis
