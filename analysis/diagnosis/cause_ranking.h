#pragma once
// Finds which effect it is: every candidate is fitted, weighed and compared with chance, pairs where they earn it.

#include <functional>
#include <string>
#include <vector>

#include "analysis/diagnosis/effect_scan.h"
#include "analysis/diagnosis/model_fit.h"

namespace metastable::analysis {

/// A hypothesis supposes one effect or two.
struct RankedCause {
  std::vector<EffectTerm> terms;
  Fit fit;
  double gain = 0;  ///< 2 Delta penalised log likelihood over the recalibrated model
  /// Is of the gain by chance: of a single effect by the variants listed, before one between them was sought; of a
  /// pair that of what the second effect earned beyond the first.
  double p_value = 1;
  double evidence = 0;  ///< log Bayes factor against the recalibrated model, prior odds of pairs included
  double together =
      1;  ///< of a pair: its gain over what its two effects gain alone, beside what each hides of the other
  std::string not_decided;  ///< why, where the data cannot tell or the fit did not settle
  bool candidate_undecided() const { return !terms[0].candidate->undecidable.empty(); }
};

struct CauseRanking {
  EffectScan scan;                   ///< at the recalibrated model
  std::vector<RankedCause> singles;  ///< every candidate, in the order of the catalogue
  std::vector<RankedCause> pairs;
  double p_value = 1;  ///< of the best single effect among those listed, with the look elsewhere
};

/// Says how much is fitted. Experiments that are large, or far off their model, would take many minutes at full effort.
struct Effort {
  double least_promise = 2;       ///< gain by the scores, for a fit
  std::size_t most_variants = 3;  ///< of one effect that are fitted
  std::size_t most_leaders = 3;   ///< single effects that are refined, and that pairs are built on if not far behind
  std::size_t most_partners = 3;  ///< of one leader that are fitted
  int refinements = 3;            ///< of a variant, each with half the moves
  int refining_steps = 4;         ///< of the fit at each move
  int most_iterations = FitOptions{}.most_iterations;
};
Effort effort_for(const TransitionModel& model, const Fit& recalibrated);

struct RankingOptions {
  int threads = 0;
  int draws = 2000;
  std::uint64_t seed = 1;
  std::vector<std::pair<const Candidate*, const Candidate*>> pairs = {};  ///< tried in any case
  std::function<void(double)> progress;  ///< share done; called from any thread, one at a time; may throw to stop
};

/// Evidence is the likelihood ratio averaged over an effect's variants and over a normal prior on its p parameters
/// whose expected gain is 36 (so that effects of one and of eight parameters start level), by Laplace's approximation:
/// log mean_v exp(gain_v g/(1+g)/2) - p/2 log(1+g), g = 36/p.
/// A second effect must earn beyond `model_error`^2 of what the first one gained in the same phase (collisions,
/// stances): no catalogue entry has exactly the form of what nature did, and a misfit of 6 % of a large effect is none
/// of its own. (An `exact` effect is forgiven nothing.) Where an effect has a prior of its own the gain pays for it
/// besides. Candidates whose scores promise less than a fifth of a large
/// best gain are not fitted.
/// @param candidates  to be considered
CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options);

/// Returns that evidence of an effect without variants. @param parameters  >= 0
double evidence_of_gain(double gain, double parameters);

inline constexpr double model_error = 0.06;

/// Is 2 Delta log likelihood of one fit over another, in stances and in everything else.
struct PhaseGain {
  double collisions = 0, stances = 0;
};
PhaseGain phase_gain(const TransitionModel& model, const Fit& better, const Fit& worse);

/// Returns the fit beyond which what `terms` gained may be off by an error of form: that of those of them that are
/// exact, or `recalibrated`. @param singles  fitted causes
const Fit& exact_part(const std::vector<RankedCause>& singles, const std::vector<EffectTerm>& terms,
                      const Fit& recalibrated);

}  // namespace metastable::analysis
