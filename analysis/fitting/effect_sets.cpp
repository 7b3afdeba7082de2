#include "analysis/fitting/effect_sets.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
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
constexpr double worth_a_round = 4;  // evidence that swaps gained, for another round of them: alike effects gain less
constexpr int most_swaps = 3;        // rounds of effects put in the place of others
constexpr std::size_t most_extended = 3;  // pairs
constexpr int times_longer = 4;           // iterations of a leading set's fit that did not converge, over those before

constexpr double hardly_more = 9;  // by a set beyond one of its parts: less, and the part bounds it in any case

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

std::vector<std::size_t> by_evidence(const std::vector<RankedCause>& all) {
  std::vector<double> evidence;
  for (const RankedCause& one : all) evidence.push_back(one.evidence);
  return falling_order(evidence);
}

const RankedCause* best_of(const std::vector<RankedCause>& all) {
  return all.empty() ? nullptr : &all[by_evidence(all).front()];
}

auto find_set(const std::vector<RankedCause>& all, const std::vector<EffectTerm>& terms) {
  return std::ranges::find_if(
      all, [&](const RankedCause& one) { return one.terms.size() == terms.size() && extends(one.terms, terms); });
}

// Returns the evidence that one more effect would add, by what its score test promises that it will earn.
double promised_evidence(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base,
                         const ScannedEffect& more) {
  const Fit& exact = exact_part(singles.causes, base.terms, problem.recalibrated);
  return evidence_of(more, promised_to_earn(problem.model, more, base.fit, exact, problem.rules), problem.rules);
}

// Weighs what the last effect of a set earned. Its variants count as they did alone.
double evidence_of_last(const RankingProblem& problem, const SingleEffects& singles, const Candidate* last,
                        double gain) {
  const ScannedEffect* scanned = singles.scan.find(last);
  return scanned ? evidence_of(*scanned, gain, problem.rules) : 0.5 * gain;
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
  problem.model.side_by_side(2, problem.threads, [&](std::size_t without) {
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
    pair.evidence = first.evidence + evidence_of_last(problem, singles, terms[1].candidate, earned) +
                    log_prior_of_one_more(problem, 2);
    found[without] = std::move(pair);
  });
  for (RankedCause& pair : found)
    if (pair.fitted()) pairs.push_back(std::move(pair));
}

// Fits what stays of a set of four and more without each of its effects, where that was not tried: an effect that led
// the search there need not be one that is at work.
void add_sets_within(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& set,
                     const std::vector<RankedCause>& pairs, std::vector<RankedCause>& sets) {
  std::vector<RankedCause> found(set.terms.size());
  problem.model.side_by_side(found.size(), problem.threads, [&](std::size_t without) {
    std::vector<EffectTerm> terms = set.terms;
    terms.erase(terms.begin() + static_cast<std::ptrdiff_t>(without));
    if (find_set(sets, terms) != sets.end()) return;
    problem.heartbeat();
    found[without] =
        as_cause(fit(problem.model, set.fit.nuisance, terms,
                     {.count = {}, .refit_nuisances = true, .most_iterations = problem.effort.most_iterations}),
                 problem.recalibrated);
    found[without].together = gain_together(problem, singles, found[without]);
  });
  std::erase_if(found, [](const RankedCause& one) { return !one.fitted() || !std::isfinite(one.evidence); });
  // A set is worth what it earns beyond a part of it; one of which no part was fitted is not weighed.
  for (RankedCause& one : found) one.evidence = std::numeric_limits<double>::infinity();
  bound_by_parts(problem, singles, set.terms.size() == 4 ? pairs : sets, found);
  std::erase_if(found, [](const RankedCause& one) { return !std::isfinite(one.evidence); });
  finish_leading(problem, found);
  std::ranges::move(found, std::back_inserter(sets));
}

// Returns the best hypotheses of a kind, the best one first; of those that gain the same and differ in one effect,
// which act alike, one stands for all.
std::vector<RankedCause> strongest_of(const std::vector<RankedCause>& all, std::size_t most, const Rules& rules) {
  std::vector<RankedCause> strongest;
  for (const std::size_t k : by_evidence(all)) {
    if (strongest.size() == most || !std::isfinite(all[k].evidence)) break;
    const bool alike = std::ranges::any_of(strongest, [&](const RankedCause& better) {
      const auto shared = std::ranges::count_if(all[k].terms, [&](const EffectTerm& term) {
        return std::ranges::find(better.terms, term.candidate, &EffectTerm::candidate) != better.terms.end();
      });
      return static_cast<std::size_t>(shared) + 1 == all[k].terms.size() &&
             std::abs(better.gain - all[k].gain) < rules.told_apart;
    });
    if (!alike) strongest.push_back(all[k]);
  }
  return strongest;
}

// Fits what is worth it beside a hypothesis, where that is not the best one what promises to come near that.
// @param best  evidence of the best  @param larger  gets the sets that it does not hold
void extend(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& base, double best,
            std::vector<RankedCause>& larger) {
  std::vector<ScannedEffect> worth = promising_beside(problem, singles, scan_beside(problem, singles, base), base);
  const double needed = best - base.evidence - log_prior_of_one_more(problem, base.terms.size() + 1) - near_top;
  std::erase_if(worth, [&](const ScannedEffect& effect) {
    if (base.evidence < best && promised_evidence(problem, singles, base, effect) < needed) return true;
    std::vector<EffectTerm> terms = base.terms;
    terms.push_back(term_at(effect, effect.best));
    return find_set(larger, terms) != larger.end();
  });
  std::vector<RankedCause> fitted(worth.size());
  problem.model.side_by_side(worth.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    fitted[i] = with_one_more(problem, singles, base, worth[i]);
  });
  std::erase_if(fitted, [](const RankedCause& one) { return !std::isfinite(one.evidence); });
  std::ranges::move(fitted, std::back_inserter(larger));
}

// Fits effects beside a hypothesis in the place of one that was taken out: those that promise about as much as the best
// one does there, and those that gain as much alone as the one taken out. Promises are off by shares of large gains. No
// set is formed anew.
std::vector<RankedCause> fit_in_place_of(const Candidate* out, const RankingProblem& problem,
                                         const SingleEffects& singles, const RankedCause& base,
                                         const std::vector<RankedCause>& known) {
  const EffectScan scan = scan_beside(problem, singles, base);
  std::vector<const ScannedEffect*> tries = about_as_promising(problem, singles, scan, base);
  const auto alone = [&](const Candidate* one) { return singles.causes[problem.index_of(one)].gain; };
  for (const ScannedEffect& effect : scan.effects)
    if (effect.candidate != out && std::ranges::find(tries, &effect) == tries.end() &&
        std::min(alone(effect.candidate), alone(out)) > problem.rules.told_apart &&
        std::abs(alone(effect.candidate) - alone(out)) < problem.rules.told_apart)
      tries.push_back(&effect);
  std::erase_if(tries, [&](const ScannedEffect* effect) {
    std::vector<EffectTerm> terms = base.terms;
    terms.push_back(term_at(*effect, effect->best));
    return find_set(known, terms) != known.end();
  });
  std::vector<RankedCause> fitted(tries.size());
  problem.model.side_by_side(tries.size(), problem.threads, [&](std::size_t k) {
    problem.heartbeat();
    fitted[k] = with_one_more(problem, singles, base, *tries[k]);
  });
  std::erase_if(fitted, [](const RankedCause& one) { return !std::isfinite(one.evidence); });
  return fitted;
}

// Puts others in the place of each effect of the best set, as long as that makes a better one: of effects that act
// alike the first that was tried need not be the one that is there.
void add_swaps(const RankingProblem& problem, const SingleEffects& singles, const std::vector<RankedCause>& pairs,
               std::vector<RankedCause>& sets) {
  for (int round = 0; round < most_swaps; ++round) {
    const std::vector<EffectTerm> best = best_of(sets)->terms;
    const double before = best_of(sets)->evidence;
    for (const EffectTerm& out : best) {
      std::vector<EffectTerm> rest = best;
      std::erase_if(rest, [&](const EffectTerm& one) { return one.candidate == out.candidate; });
      const std::vector<RankedCause>& parts = rest.size() == 2 ? pairs : sets;
      const auto part = find_set(parts, rest);
      if (part == parts.end() || !part->fitted() || !std::isfinite(part->evidence)) continue;
      problem.heartbeat();
      std::ranges::move(fit_in_place_of(out.candidate, problem, singles, RankedCause(*part), sets),
                        std::back_inserter(sets));
    }
    bound_by_parts(problem, singles, pairs, sets);
    bound_by_parts(problem, singles, sets, sets);
    if (best_of(sets)->evidence < before + worth_a_round) return;
  }
}

}  // namespace

double log_prior_of_one_more(const RankingProblem& problem, std::size_t size) {
  const double k = static_cast<double>(size), others = static_cast<double>(problem.candidates.size()) - k + 1;
  return std::log(problem.rules.pair_prior / std::max(1.0, others / k));
}

std::vector<const ScannedEffect*> about_as_promising(const RankingProblem& problem, const SingleEffects& singles,
                                                     const EffectScan& scan, const RankedCause& base) {
  std::vector<double> promised;
  for (const ScannedEffect& effect : scan.effects)
    promised.push_back(promised_evidence(problem, singles, base, effect));
  std::vector<const ScannedEffect*> all;
  for (std::size_t k = 0; k < promised.size(); ++k)
    if (promised[k] > std::ranges::max(promised) - alike_margin) all.push_back(&scan.effects[k]);
  return all;
}

std::vector<ScannedEffect> promising_beside(const RankingProblem& problem, const SingleEffects& singles,
                                            const EffectScan& scan, const RankedCause& base) {
  std::vector<ScannedEffect> worth;
  std::vector<double> promises;
  std::vector<const ScannedEffect*> promising;
  const double prior = log_prior_of_one_more(problem, base.terms.size() + 1);
  for (const ScannedEffect& effect : scan.effects) {
    const double promised = promised_evidence(problem, singles, base, effect);
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
  set.evidence = base.evidence + evidence_of(more, last, problem.rules) + std::min(0.0, 0.5 * (set.gain - base.gain)) +
                 log_prior_of_one_more(problem, base.terms.size() + 1);
  return set;
}

void finish_leading(const RankingProblem& problem, std::vector<RankedCause>& sets) {
  const RankedCause* best = best_of(sets);
  const double least = best ? best->evidence - alike_margin : 0;
  problem.model.side_by_side(sets.size(), problem.threads, [&](std::size_t k) {
    RankedCause& set = sets[k];
    if (!set.fitted() || set.fit.converged || !(set.evidence >= least)) return;
    problem.heartbeat();
    Fit longer =
        fit(problem.model, set.fit.nuisance, set.terms,
            {.count = {}, .refit_nuisances = true, .most_iterations = times_longer * problem.effort.most_iterations});
    if (!(longer.penalised > set.fit.penalised)) return;
    set.not_decided = longer.converged ? "" : longer.reason;
    set.take(std::move(longer), problem.recalibrated);
  });
}

std::vector<RankedCause> rank_larger_sets(const RankingProblem& problem, const SingleEffects& singles,
                                          std::vector<RankedCause>& pairs) {
  std::vector<RankedCause> sets;
  const RankedCause* pair = best_of(pairs);
  if (!pair || pair->evidence < singles.top - near_top) return sets;
  const double pair_evidence = pair->evidence;
  std::vector<RankedCause> bases = strongest_of(pairs, most_extended, problem.rules);
  while (bases.front().terms.size() < problem.effort.most_effects) {
    const double before = bases.front().evidence;
    std::vector<RankedCause> larger;
    for (const RankedCause& base : bases) {
      problem.heartbeat();
      extend(problem, singles, base, std::max(before, singles.top), larger);
    }
    bound_by_parts(problem, singles, bases.front().terms.size() == 2 ? pairs : sets, larger);
    finish_leading(problem, larger);
    bases = strongest_of(larger, 1, problem.rules);
    std::ranges::move(larger, std::back_inserter(sets));
    if (bases.empty() || bases.front().evidence < before) break;
    if (bases.front().terms.size() == 3)
      add_pairs_within(problem, singles, bases.front(), pairs);
    else
      add_sets_within(problem, singles, bases.front(), pairs, sets);
  }
  if (const RankedCause* best = best_of(sets); best && best->evidence > pair_evidence)
    add_swaps(problem, singles, pairs, sets);
  return sets;
}

void bound_by_parts(const RankingProblem& problem, const SingleEffects& singles, const std::vector<RankedCause>& parts,
                    std::vector<RankedCause>& sets) {
  for (RankedCause& set : sets) {
    std::vector<const RankedCause*> whole;  // parts beyond which it gains, each with the effect that it lacks
    std::vector<const Candidate*> lacks;
    std::vector<double> evidence;
    double least = std::numeric_limits<double>::infinity();
    for (const EffectTerm& last : set.terms) {
      std::vector<EffectTerm> others = set.terms;
      std::erase_if(others, [&](const EffectTerm& one) { return one.candidate == last.candidate; });
      const auto part = find_set(parts, others);
      if (part == parts.end() || !part->fitted() || !std::isfinite(part->evidence)) continue;
      const double beyond = set.gain - part->gain;
      if (beyond <= hardly_more) {
        const auto parameters = static_cast<double>(last.candidate->parameters.size());
        // A fit that ended below the part's has lost what it gains less.
        least = std::min(least, part->evidence + std::min(0.0, 0.5 * beyond) +
                                    evidence_of_gain(std::max(0.0, beyond), parameters, problem.rules));
      } else if (!last.candidate->exact) {
        // An exact effect is not the last one: the others, beside it, have no error of form to be forgiven.
        whole.push_back(&*part), lacks.push_back(last.candidate), evidence.push_back(part->evidence);
      }
    }
    const double prior = log_prior_of_one_more(problem, set.terms.size());
    if (!whole.empty()) {
      const std::size_t k = falling_order(evidence).front();
      const Fit& exact = exact_part(singles.causes, whole[k]->terms, problem.recalibrated);
      set.evidence = whole[k]->evidence + prior +
                     evidence_of_last(problem, singles, lacks[k],
                                      earned(problem.model, set.fit, whole[k]->fit, exact, problem.rules));
    }
    set.evidence = std::min(set.evidence, least + prior);
  }
}

}  // namespace metastable::analysis
