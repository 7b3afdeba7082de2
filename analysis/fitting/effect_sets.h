#pragma once
// Builds hypotheses of several effects: what is worth a fit beside one, what its last effect earns, and sets of three
// and more.

#include <cstddef>
#include <vector>

#include "analysis/fitting/single_effects.h"

namespace metastable::analysis {

/// Evidence promised below that of the best one in an effect's place, for an effect worth fitting there. This saves
/// time.
inline constexpr double alike_margin = 4;

/// Lists the effects of a scan beside a hypothesis that promise to earn about as much as the best one of it, to
/// alike_margin.
std::vector<const ScannedEffect*> about_as_promising(const RankingProblem& problem, const SingleEffects& singles,
                                                     const EffectScan& scan, const RankedCause& base);

/// Returns the log prior odds of a set of effects to the same without its last one, any of the others in its place.
/// @param size  effects of the set, >= 2
double log_prior_of_one_more(const RankingProblem& problem, std::size_t size);

/// Lists the effects that promise to earn most beside a hypothesis. An effect for which the model knows better starts
/// than the scores is listed whatever its scores promise.
/// @param scan  beside it
std::vector<ScannedEffect> promising_beside(const RankingProblem& problem, const SingleEffects& singles,
                                            const EffectScan& scan, const RankedCause& base);

/// Continues the fits that did not converge of the sets whose evidence is within alike_margin of the best.
void finish_leading(const RankingProblem& problem, std::vector<RankedCause>& sets);

/// Fits one more effect beside a hypothesis, and weighs the two together by what the last one earns.
RankedCause with_one_more(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base,
                          const ScannedEffect& more);

/// Sets what a hypothesis says of its last effect, and returns what that earned beyond `base`.
double measure_last(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base,
                    RankedCause& set);

/// Returns RankedCause::together of a hypothesis: what it gains over what its effects gain alone. What one scatters
/// hides part of the others: of n normal errors a gain of g says that their variance falls by exp(-g / n), by which the
/// gain of another one rises.
double gain_together(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& set);

/// Extends the best pair, one effect after the other, as long as the last one earns its place, up to
/// Effort::most_effects, and puts others in the place of each effect of the best set. Every set shows smaller ones,
/// too: what stays of it without one of its effects.
/// @param pairs  gets pairs that a larger set came upon
/// @return sets of three and more
std::vector<RankedCause> rank_larger_sets(const RankingProblem& problem, const SingleEffects& singles,
                                          std::vector<RankedCause>& pairs);

/// Weighs sets by what they earn beyond the best of their parts, whichever came first in the search, so that sets that
/// act alike are worth alike; the last effect is none that is exact. A set that gains nothing beyond a part of it is
/// that part.
/// @param parts  hypotheses of one effect less among them; may be `sets`
void bound_by_parts(const RankingProblem& problem, const SingleEffects& singles, const std::vector<RankedCause>& parts,
                    std::vector<RankedCause>& sets);

}  // namespace metastable::analysis
