#pragma once
// Which effect: every candidate fitted, weighed and compared with chance; pairs where they earn it.

#include <functional>
#include <string>
#include <vector>

#include "analysis/effect_scan.h"
#include "analysis/model_fit.h"

namespace metastable::analysis {

/// One hypothesis: one effect or two.
struct RankedCause {
  std::vector<Term> terms;
  Fit fit;
  double gain = 0;      ///< 2 Delta penalised log likelihood over the recalibrated model
  double p_value = 1;   ///< of the (last) effect's gain by chance
  double evidence = 0;  ///< log Bayes factor against the recalibrated model, prior odds of pairs included
  std::string not_decided;
};

struct CauseRanking {
  EffectScan scan;                   ///< at the recalibrated model
  std::vector<RankedCause> singles;  ///< every candidate, in the order of the catalogue
  std::vector<RankedCause> pairs;
  double p_value = 1;  ///< of the best single effect, with the look elsewhere
};

struct RankingOptions {
  int threads = 0;
  int draws = 2000;
  std::uint64_t seed = 1;
  std::function<void(double)> progress;  ///< share done
};

/// Evidence: the likelihood ratio averaged over an effect's variants and over a normal prior on its p parameters whose
/// expected gain is 36 (so that effects of one and of eight parameters start level), by Laplace's approximation:
/// log mean_v exp(gain_v g/(1+g)/2) - p/2 log(1+g), g = 36/p.
/// A second effect must earn beyond `model_error`^2 of the first one's gain: no catalogue entry has exactly the form of
/// what nature did, and a misfit of 2 % of a large effect is none of its own.
/// @param candidates  to be considered
CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options);

inline constexpr double model_error = 0.02;

}  // namespace metastable::analysis
