#include "analysis/fitting/effect_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "analysis/fitting/evidence.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// These numbers save time: they say which pairs are fitted.
constexpr double least_pair_evidence = -4;  // promised beyond the first effect's, for a pair worth fitting
constexpr double alike_margin = 4;          // evidence promised below the best second effect's, for one worth fitting

// These numbers say when an effect is fitted again from where a pair has it.
constexpr double gained_beside = 9;  // by the pair, beyond the effect's own gain
constexpr double lost_alone = 30;    // most that it is short of its own fit there, without the other [log likelihood]
constexpr std::size_t most_other_ways = 3;

// A pair that is worth a fit: a leading effect, and what was scanned beside its fit.
struct Try {
  std::size_t leader;
  ScannedEffect second;
};

// Scans of all others beside the fits of leaders, each once.
class ScansBeside {
 public:
  ScansBeside(const RankingProblem& problem) : problem_(problem) {}

  const EffectScan& of(const SingleEffects& singles, std::size_t leader) {
    if (const auto known = scans_.find(leader); known != scans_.end()) return known->second;
    const RankedCause& first = singles.causes[leader];
    std::vector<const Candidate*> others;
    for (const Candidate* other : problem_.candidates)
      if (other != first.terms[0].candidate) others.push_back(other);
    return scans_
        .emplace(leader, scan_effects(problem_.model, first.fit, others, problem_.threads,
                                      {&singles.scan, first.terms[0].candidate}))
        .first->second;
  }
  // Forgets a leader that was fitted anew.
  void forget(std::size_t leader) { scans_.erase(leader); }

 private:
  const RankingProblem& problem_;
  std::map<std::size_t, EffectScan> scans_;
};

double pair_log_prior(const RankingProblem& problem) {
  return std::log(problem.rules.pair_prior / std::max(1.0, 0.5 * static_cast<double>(problem.candidates.size() - 1)));
}

// Says whether the model itself tells where the last term starts beside the others.
bool knows_start(const TransitionModel& model, const std::vector<EffectTerm>& terms) {
  const std::vector<FitStart> starts = model.starts(terms);
  return std::any_of(starts.begin(), starts.end(),
                     [&](const FitStart& start) { return start.values.back() != terms.back().values; });
}

bool is_tried(const std::vector<Try>& tries, std::size_t leader, const Candidate* second) {
  return std::ranges::any_of(tries, [&](const Try& t) { return t.leader == leader && t.second.candidate == second; });
}

// Lists what promises most beside a leader. Where the model knows better starts than the scores, the scores do not
// decide.
std::vector<Try> tries_beside(const RankingProblem& problem, const EffectScan& scan, const RankedCause& first,
                              std::size_t leader) {
  std::vector<Try> tries;
  std::vector<std::pair<double, const ScannedEffect*>> promising;
  for (const ScannedEffect& effect : scan.effects) {
    const double promised = evidence_of(effect, effect.gain[effect.best], problem.rules);
    std::vector<EffectTerm> both = first.terms;
    both.push_back(term_at(effect, effect.best));
    if (knows_start(problem.model, both))
      tries.push_back({leader, effect});
    else if (promised + pair_log_prior(problem) > least_pair_evidence)
      promising.emplace_back(promised, &effect);
  }
  std::sort(promising.begin(), promising.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (std::size_t k = 0; k < std::min(problem.effort.most_partners, promising.size()); ++k)
    tries.push_back({leader, *promising[k].second});
  return tries;
}

// Scans the pairs asked for, whatever the scores promise.
void add_asked_pairs(const RankingProblem& problem, SingleEffects& singles,
                     const std::vector<std::pair<const Candidate*, const Candidate*>>& asked, std::vector<Try>& tries) {
  for (auto [one, other] : asked) {
    if (other->parameters.empty()) std::swap(one, other);  // another law has nothing to scan
    const std::size_t leader = problem.index_of(one);
    RankedCause& first = singles.causes[leader];
    if (first.candidate_undecided() || !other->undecidable.empty() || other->parameters.empty() ||
        is_tried(tries, leader, other))
      continue;
    if (!first.fitted()) first = fitted_effect(problem, singles, *singles.scan.find(one));
    tries.push_back(
        {leader,
         scan_effects(problem.model, first.fit, {other}, problem.threads, {&singles.scan, one}).effects.front()});
  }
}

// Sums what the two effects of a pair gain each by itself. What one scatters hides part of the other: of n normal
// errors a gain of g says that their variance falls by exp(-g / n), by which the other's gain rises.
double gain_apart(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& pair) {
  const auto gain_of = [&](const EffectTerm& term) {
    return std::max(0.0, singles.causes[problem.index_of(term.candidate)].gain);
  };
  const auto collisions = static_cast<double>(std::ranges::count_if(problem.model.events(), [](const Event& event) {
    return event.kind == EventKind::collision || event.kind == EventKind::step;
  }));
  const auto beside = [&](double one, double other) {
    return one + other * std::exp(std::min(problem.rules.most_hidden, one / std::max(1.0, collisions)));
  };
  const double one = gain_of(pair.terms[0]), other = gain_of(pair.terms[1]);
  return std::max(beside(one, other), beside(other, one));
}

double together(const RankingProblem& problem, const SingleEffects& singles, const RankedCause& pair) {
  return pair.gain / std::max(1.0, gain_apart(problem, singles, pair));
}

// Sets what a pair says of its second effect, and returns what that earned.
double measure_second(const RankingProblem& problem, const SingleEffects& singles, RankedCause& pair) {
  const RankedCause& first = singles.causes[problem.index_of(pair.terms[0].candidate)];
  const double second = earned(problem.model, pair.fit, first.fit,
                               exact_part(singles.causes, first.terms, problem.recalibrated), problem.rules);
  pair.p_value = 2 * dynamics::normal_cdf(-std::sqrt(second));
  pair.together = together(problem, singles, pair);
  return second;
}

// Fits pairs. The same pair, from either side or once more, counts once, the better fit.
void fit_pairs(const RankingProblem& problem, const SingleEffects& singles, const std::vector<Try>& tries,
               std::vector<RankedCause>& pairs) {
  std::vector<RankedCause> tried(tries.size());
  markov::parallel_for(tries.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    const RankedCause& first = singles.causes[tries[i].leader];
    RankedCause& pair = tried[i];
    pair = as_cause(fit_one_more(problem.model, problem.effort, first.fit, tries[i].second), problem.recalibrated);
    if (!std::isfinite(pair.evidence)) return;
    const double second = measure_second(problem, singles, pair);
    pair.evidence = first.evidence + evidence_of(tries[i].second, second, problem.rules) + pair_log_prior(problem);
  });
  for (RankedCause& pair : tried) {
    const auto same =
        std::ranges::find_if(pairs, [&](const RankedCause& other) { return extends(other.terms, pair.terms); });
    if (same == pairs.end())
      pairs.push_back(std::move(pair));
    else if (pair.evidence > same->evidence)
      *same = std::move(pair);
  }
}

// What a pair gains beyond its first effect may be a better optimum of that effect, which the pair's fit came upon.
void refit_from_pairs(const RankingProblem& problem, EffectPairs& ranked, ScansBeside& beside) {
  SingleEffects& singles = ranked.singles;
  std::vector<const RankedCause*> gaining;
  for (const RankedCause& pair : ranked.pairs) {
    const RankedCause& first = singles.causes[problem.index_of(pair.terms[0].candidate)];
    if (std::isfinite(pair.evidence) && !pair.terms[0].candidate->parameters.empty() &&
        pair.gain > first.gain + gained_beside &&
        problem.model.evaluate(pair.fit.nuisance, std::vector{pair.terms[0]}).total() >
            first.fit.log_likelihood - lost_alone)
      gaining.push_back(&pair);
  }
  std::sort(gaining.begin(), gaining.end(),
            [](const RankedCause* a, const RankedCause* b) { return a->gain > b->gain; });
  gaining.resize(std::min(gaining.size(), most_other_ways));
  std::vector<Fit> again(gaining.size());
  markov::parallel_for(gaining.size(), problem.threads, [&](std::size_t k) {
    problem.heartbeat();
    again[k] = fit(problem.model, gaining[k]->fit.nuisance, {gaining[k]->terms[0]},
                   {.count = {}, .refit_nuisances = true, .most_iterations = problem.effort.most_iterations});
  });
  bool any = false;
  for (std::size_t k = 0; k < again.size(); ++k) {
    const std::size_t i = problem.index_of(gaining[k]->terms[0].candidate);
    if (!(problem.gain(again[k]) > singles.causes[i].gain + 1)) continue;
    singles.take(problem, i, std::move(again[k]));
    beside.forget(i);
    singles.top = std::max(singles.top, singles.causes[i].evidence);
    any = true;
  }
  if (!any) return;
  for (RankedCause& pair : ranked.pairs)
    if (std::isfinite(pair.evidence)) measure_second(problem, singles, pair);
}

// Returns the best pair if its evidence is about as large as that of the best effect, else null.
const RankedCause* near_best_pair(const EffectPairs& ranked) {
  const auto best = std::ranges::max_element(ranked.pairs, {}, &RankedCause::evidence);
  return best == ranked.pairs.end() || best->evidence < ranked.singles.top - alike_margin ? nullptr : &*best;
}

// An effect of the best pair that was not worth refining by itself is refined now, and paired anew.
void refine_paired(const RankingProblem& problem, EffectPairs& ranked, ScansBeside& beside) {
  const RankedCause* best = near_best_pair(ranked);
  if (!best) return;
  std::vector<Try> tries;
  for (const EffectTerm& term : best->terms) {
    const std::size_t i = problem.index_of(term.candidate);
    if (ranked.singles.refined[i] || term.candidate->refine.empty() || !ranked.singles.causes[i].fitted()) continue;
    const Candidate* partner = best->terms[&term == &best->terms[0] ? 1 : 0].candidate;
    problem.heartbeat();
    refine_effect(problem, ranked.singles, i);
    beside.forget(i);
    const EffectScan& scan = beside.of(ranked.singles, i);
    for (Try& one : tries_beside(problem, scan, ranked.singles.causes[i], i)) tries.push_back(std::move(one));
    // Another law has nothing to scan.
    const ScannedEffect* second = scan.find(partner);
    if (second && !is_tried(tries, i, partner)) tries.push_back({i, *second});
  }
  if (tries.empty()) return;
  for (RankedCause& pair : ranked.pairs) pair.together = together(problem, ranked.singles, pair);
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
}

// Beside one effect of the best pair others may act like its second one, as torques do: all that promise about as much
// are fitted, so that a set names them.
void complete_pairs(const RankingProblem& problem, EffectPairs& ranked, ScansBeside& beside) {
  const RankedCause* best = near_best_pair(ranked);
  if (!best) return;
  std::vector<Try> tries;
  for (const EffectTerm& term : best->terms) {
    const std::size_t leader = problem.index_of(term.candidate);
    if (!ranked.singles.causes[leader].fitted()) continue;
    const EffectScan& scan = beside.of(ranked.singles, leader);
    std::vector<double> promised;
    for (const ScannedEffect& effect : scan.effects)
      promised.push_back(evidence_of(effect, effect.gain[effect.best], problem.rules));
    if (promised.empty()) continue;
    const double most = *std::max_element(promised.begin(), promised.end());
    for (std::size_t k = 0; k < promised.size(); ++k)
      if (promised[k] > most - alike_margin && std::ranges::none_of(ranked.pairs, [&](const RankedCause& pair) {
            return extends(pair.terms, {term, term_at(scan.effects[k], scan.effects[k].best)});
          }))
        tries.push_back({leader, scan.effects[k]});
  }
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
}

// Evidence shrinks gains by the number of parameters: eight leg lengths, which take in an eccentric hub, would count
// for less than the hub with them beside it. A pair that gains nothing beyond one of its effects is that effect.
void bound_pairs(const RankingProblem& problem, EffectPairs& ranked) {
  for (RankedCause& pair : ranked.pairs)
    for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
      const RankedCause& one = ranked.singles.causes[problem.index_of(pair.terms[k].candidate)];
      const double beyond = pair.gain - one.gain;
      if (!one.fitted() || !std::isfinite(one.evidence) || beyond > gained_beside) continue;
      const auto parameters = static_cast<double>(pair.terms[1 - k].candidate->parameters.size());
      pair.evidence =
          std::min(pair.evidence, one.evidence + evidence_of_gain(std::max(0.0, beyond), parameters, problem.rules) +
                                      pair_log_prior(problem));
    }
}

}  // namespace

EffectPairs rank_effect_pairs(const RankingProblem& problem, SingleEffects singles, const RankingOptions& options,
                              const std::function<void()>& chosen) {
  EffectPairs ranked{std::move(singles), {}};
  ScansBeside beside(problem);
  std::vector<Try> tries;
  for (const std::size_t leader : leading_effects(problem, ranked.singles))
    for (Try& one : tries_beside(problem, beside.of(ranked.singles, leader), ranked.singles.causes[leader], leader))
      tries.push_back(std::move(one));
  add_asked_pairs(problem, ranked.singles, options.pairs, tries);
  chosen();
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
  refit_from_pairs(problem, ranked, beside);
  refine_paired(problem, ranked, beside);
  complete_pairs(problem, ranked, beside);
  bound_pairs(problem, ranked);
  return ranked;
}

}  // namespace metastable::analysis
