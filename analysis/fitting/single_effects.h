#pragma once
// Ranks single effects: every candidate is scanned, fitted where it is worth a fit, and weighed.

#include <cstddef>
#include <functional>
#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/ranking_problem.h"

namespace metastable::analysis {

/// Single effects, fitted and weighed.
struct SingleEffects {
  EffectScan scan;                  ///< at the recalibrated model
  ChanceGains chance;               ///< of its gains
  std::vector<RankedCause> causes;  ///< every candidate, in the order of the problem
  std::vector<char> refined;        ///< by candidate: its variant was sought between the listed ones
  double least_p = 1;               ///< of the effects as listed, for which chance is drawn
  double top = 0;                   ///< evidence of the best

  /// Returns the probability that this effect alone gains as much by chance.
  double p_value(const Candidate* candidate, double gain) const;
  /// Takes a better fit of a single effect. Where its variant is refined the p-value stays that of the listed ones:
  /// chance has not been drawn between them.
  void take(const RankingProblem& problem, std::size_t i, Fit better);
  void update_top();
};

/// Scans and fits single effects, tries again the fits that did not converge, and refines the variants of the leading
/// ones.
/// @param halfway  called when all are fitted once
SingleEffects rank_single_effects(const RankingProblem& problem, const RankingOptions& options,
                                  const std::function<void()>& halfway);

/// A pair gains up to 2.8 times what the stronger of its effects gains alone, and 12 more: an effect for which that is
/// less than the best gain of all leads no pair. This saves time.
inline constexpr double pair_share = 2.8, pair_margin = 12;

/// Lists effects by falling evidence that pairs are built on.
std::vector<std::size_t> leading_effects(const RankingProblem& problem, const SingleEffects& singles);

/// Fits one effect beside the recalibrated model, and weighs it.
RankedCause fitted_effect(const RankingProblem& problem, const SingleEffects& singles, const ScannedEffect& scanned);

/// Refines the variant of a single effect.
void refine_effect(const RankingProblem& problem, SingleEffects& singles, std::size_t i);

}  // namespace metastable::analysis
