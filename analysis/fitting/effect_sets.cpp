#include "analysis/fitting/effect_sets.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/statistics/falling_order.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// These numbers save time: they say which sets are fitted.
constexpr double least_more_evidence = -4;  // promised beyond a hypothesis, for one more effect worth fitting
constexpr double near_top = 4;              // evidence below the best, of a pair that is extended

constexpr double hardly_more = 9;  // by a set beyond one of its parts: less, and the part bounds it

// Says whether the model itself tells where the last term starts beside the others.
bool knows_start(const TransitionModel& model, const std::vector<EffectTerm>& terms) {
  const std::vector<FitStart> starts = model.starts(terms);
  return std::any_of(starts.begin(), starts.end(),
                     [&](const FitStart& start) { return start.values.back() != terms.back().values; });
}

EffectScan scan_beside(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base) {
  std::vector<const Candidate*> others;
  for (const Candidate* other : problem.candidates)
    if (std::ranges::find(base.terms, other, &EffectTerm::candidate) == base.terms.end()) others.push_back(other);
  return scan_effects(problem.model, base.fit, others, problem.threads, {&singles.scan, base.terms.front().candidate});
}

const RankedCause* best_of(const std::vector<RankedCause>& all) {
  const auto best = std::ranges::max_element(all, {}, &RankedCause::evidence);
  return best == all.end() ? nullptr : &*best;
}

auto find_set(const std::vector<RankedCause>& all, const std::vector<EffectTerm>& terms) {
  return std::ranges::find_if(
      all, [&](const RankedCause& one) { return one.terms.size() == terms.size() && extends(one.terms, terms); });
}

// Returns the better of the two single effects of a pair, as what the other one is beside.
const RankedCause& stronger(const RankingProblem& problem, const SingleEffects& singles,
                            const std::vector<EffectTerm>& pair) {
  const RankedCause& one = singles.causes[problem.index_of(pair[0].candidate)];
  const RankedCause& other = singles.causes[problem.index_of(pair[1].candidate)];
  return one.evidence > other.evidence ? one : other;
}

// Fits what stays of a set of three without each of its first two effects: pairs that no score promised.
void add_pairs_within(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& set,
                      std::vector<RankedCause>& pairs) {
  std::vector<RankedCause> found(2);
  markov::parallel_for(2, problem.threads, [&](std::size_t without) {
    std::vector<EffectTerm> terms = set.terms;
    terms.erase(terms.begin() + static_cast<std::ptrdiff_t>(without));
    if (find_set(pairs, terms) != pairs.end()) return;
    const RankedCause& first = stronger(problem, singles, terms);
    if (!first.fitted() || !std::isfinite(first.evidence)) return;
    if (terms[0].candidate != first.terms[0].candidate) std::swap(terms[0], terms[1]);
    problem.heartbeat();
    RankedCause pair =
        as_cause(fit(problem.model, set.fit.nuisance, terms,
                     {.count = {}, .refit_nuisances = true, .most_iterations = problem.effort.most_iterations}),
                 problem.recalibrated);
    if (!std::isfinite(pair.evidence)) return;
    const double earned = measure_last(problem, singles, first, pair);
    const auto parameters = static_cast<double>(terms[1].candidate->parameters.size());
    pair.evidence = first.evidence + evidence_of_gain(earned, parameters, problem.rules) -
                    std::log(static_cast<double>(terms[1].candidate->variants.size())) +
                    log_prior_of_one_more(problem, 2);
    found[without] = std::move(pair);
  });
  for (RankedCause& pair : found)
    if (pair.fitted()) pairs.push_back(std::move(pair));
}

}  // namespace

double log_prior_of_one_more(const RankingProblem& problem, std::size_t size) {
  const double k = static_cast<double>(size), others = static_cast<double>(problem.candidates.size()) - k + 1;
  return std::log(problem.rules.pair_prior / std::max(1.0, others / k));
}

std::vector<ScannedEffect> promising_beside(const RankingProblem& problem, const EffectScan& scan,
                                            const RankedCause& base) {
  std::vector<ScannedEffect> worth;
  std::vector<double> promises;
  std::vector<const ScannedEffect*> promising;
  const double prior = log_prior_of_one_more(problem, base.terms.size() + 1);
  for (const ScannedEffect& effect : scan.effects) {
    const double promised = evidence_of(effect, effect.gain[effect.best], problem.rules);
    std::vector<EffectTerm> terms = base.terms;
    terms.push_back(term_at(effect, effect.best));
    if (knows_start(problem.model, terms))
      worth.push_back(effect);
    else if (promised + prior > least_more_evidence)
      promises.push_back(promised), promising.push_back(&effect);
  }
  const std::vector<std::size_t> order = falling_order(promises);
  for (std::size_t k = 0; k < std::min(problem.effort.most_partners, order.size()); ++k)
    worth.push_back(*promising[order[k]]);
  return worth;
}

double gain_together(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& set) {
  std::vector<double> gains;
  for (const EffectTerm& term : set.terms)
    gains.push_back(std::max(0.0, singles.causes[problem.index_of(term.candidate)].gain));
  const auto collisions = static_cast<double>(std::ranges::count_if(problem.model.events(), [](const Event& event) {
    return event.kind == EventKind::collision || event.kind == EventKind::step;
  }));
  std::ranges::sort(gains);
  double apart = 0;
  do {
    double sum = 0;
    for (const double gain : gains)
      sum += gain * std::exp(std::min(problem.rules.most_hidden, sum / std::max(1.0, collisions)));
    apart = std::max(apart, sum);
  } while (std::ranges::next_permutation(gains).found);
  return set.gain / std::max(1.0, apart);
}

double measure_last(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base,
                    RankedCause& set) {
  const double last = earned(problem.model, set.fit, base.fit,
                             exact_part(singles.causes, base.terms, problem.recalibrated), problem.rules);
  set.p_value = 2 * dynamics::normal_cdf(-std::sqrt(last));
  set.together = gain_together(problem, singles, set);
  return last;
}

RankedCause with_one_more(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base,
                          const ScannedEffect& more) {
  RankedCause set = as_cause(fit_one_more(problem.model, problem.effort, base.fit, more), problem.recalibrated);
  if (!std::isfinite(set.evidence)) return set;
  const double last = measure_last(problem, singles, base, set);
  set.evidence =
      base.evidence + evidence_of(more, last, problem.rules) + log_prior_of_one_more(problem, base.terms.size() + 1);
  return set;
}

std::vector<RankedCause> rank_larger_sets(const RankingProblem& problem, const SingleEffects& singles,
                                          std::vector<RankedCause>& pairs) {
  std::vector<RankedCause> sets;
  const RankedCause* pair = best_of(pairs);
  if (!pair || pair->evidence < singles.top - near_top) return sets;
  RankedCause base = *pair;
  while (base.terms.size() < problem.effort.most_effects) {
    problem.heartbeat();
    const std::vector<ScannedEffect> worth = promising_beside(problem, scan_beside(problem, singles, base), base);
    std::vector<RankedCause> larger(worth.size());
    markov::parallel_for(worth.size(), problem.threads, [&](std::size_t i) {
      problem.heartbeat();
      larger[i] = with_one_more(problem, singles, base, worth[i]);
    });
    std::erase_if(larger, [](const RankedCause& one) { return !std::isfinite(one.evidence); });
    bound_by_parts(problem, base.terms.size() == 2 ? pairs : sets, larger);
    const RankedCause* best = best_of(larger);
    if (!best || best->evidence < base.evidence) {
      std::ranges::move(larger, std::back_inserter(sets));
      break;
    }
    if (base.terms.size() == 2) add_pairs_within(problem, singles, *best, pairs);
    base = *best;
    std::ranges::move(larger, std::back_inserter(sets));
  }
  return sets;
}

void bound_by_parts(const RankingProblem& problem, const std::vector<RankedCause>& parts,
                    std::vector<RankedCause>& sets) {
  for (RankedCause& set : sets)
    for (const EffectTerm& term : set.terms) {
      std::vector<EffectTerm> others = set.terms;
      std::erase_if(others, [&](const EffectTerm& one) { return one.candidate == term.candidate; });
      const auto part = find_set(parts, others);
      if (part == parts.end() || !part->fitted() || !std::isfinite(part->evidence)) continue;
      const double beyond = set.gain - part->gain;
      if (beyond > hardly_more) continue;
      const auto parameters = static_cast<double>(term.candidate->parameters.size());
      set.evidence =
          std::min(set.evidence, part->evidence + evidence_of_gain(std::max(0.0, beyond), parameters, problem.rules) +
                                     log_prior_of_one_more(problem, set.terms.size()));
    }
}

}  // namespace metastable::analysis
