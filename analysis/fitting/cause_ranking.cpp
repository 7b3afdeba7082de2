#include "analysis/fitting/cause_ranking.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "analysis/fitting/effect_pairs.h"
#include "analysis/fitting/effect_sets.h"
#include "analysis/fitting/single_effects.h"
#include "markov/parallel.h"

namespace metastable::analysis {

void RankedCause::take(Fit better, const Fit& recalibrated) {
  const double now = 2 * (better.penalised - recalibrated.penalised);
  evidence += 0.5 * (now - gain);
  gain = now;
  fit = std::move(better);
  terms = fit.terms;
}

RankedCause as_cause(Fit fit, const Fit& recalibrated) {
  RankedCause cause;
  cause.terms = fit.terms;
  if (!fit.converged) cause.not_decided = fit.reason;
  cause.gain = 2 * (fit.penalised - recalibrated.penalised);
  cause.fit = std::move(fit);
  if (std::isfinite(cause.gain)) return cause;
  // A hypothesis whose likelihood is not finite anywhere the fit began is given up.
  cause.not_decided = cause.fit.reason.empty() ? "its likelihood is not finite" : cause.fit.reason;
  cause.gain = 0;
  cause.evidence = -std::numeric_limits<double>::infinity();
  return cause;
}

bool extends(const std::vector<EffectTerm>& terms, const std::vector<EffectTerm>& others) {
  return std::ranges::all_of(others, [&](const EffectTerm& wanted) {
    return std::ranges::find(terms, wanted.candidate, &EffectTerm::candidate) != terms.end();
  });
}

const Fit& exact_part(const std::vector<RankedCause>& singles, const std::vector<EffectTerm>& terms,
                      const Fit& recalibrated) {
  for (const EffectTerm& term : terms)
    for (const RankedCause& cause : singles)
      if (term.candidate->exact && cause.terms[0].candidate == term.candidate && cause.fitted()) return cause.fit;
  return recalibrated;
}

CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options) {
  double share = 0;
  const std::function<void()> beat = markov::one_at_a_time([&] {
    if (options.progress) options.progress(share);
  });
  const auto reach = [&](double reached) {
    share = reached;
    beat();
  };
  const RankingProblem problem{
      model, recalibrated, candidates, options.rules, options.threads, effort_for(model, recalibrated), beat};
  reach(0.15);
  SingleEffects singles = rank_single_effects(problem, options, [&] { reach(0.5); });
  reach(0.6);
  EffectPairs ranked = rank_effect_pairs(problem, std::move(singles), options, [&] { reach(0.8); });
  reach(0.95);
  bound_by_parts(problem, ranked.singles, ranked.singles.causes, ranked.pairs);
  std::vector<RankedCause> sets = rank_larger_sets(problem, ranked.singles, ranked.pairs);
  bound_by_parts(problem, ranked.singles, ranked.singles.causes, ranked.pairs);
  bound_by_parts(problem, ranked.singles, ranked.pairs, sets);
  bound_by_parts(problem, ranked.singles, sets, sets);
  reach(1);
  const double p_value = ranked.singles.chance.look_elsewhere(ranked.singles.least_p);
  return {std::move(ranked.singles.scan), std::move(ranked.singles.causes), std::move(ranked.pairs), std::move(sets),
          p_value};
}

}  // namespace metastable::analysis
