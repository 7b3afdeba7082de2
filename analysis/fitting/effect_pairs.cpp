#include "analysis/fitting/effect_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/effect_sets.h"
#include "analysis/statistics/falling_order.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// These numbers say when an effect is fitted again from where a pair has it.
constexpr double gained_beside = 9;  // by the pair, beyond the effect's own gain
constexpr double lost_alone = 30;    // most that it is short of its own fit there, without the other [log likelihood]
constexpr std::size_t most_other_ways = 3;
constexpr double alike_from = 12;  // evidence of an effect alone, for others as likely to be tried in its place

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

bool is_tried(const std::vector<Try>& tries, std::size_t leader, const Candidate* second) {
  return std::ranges::any_of(tries, [&](const Try& t) { return t.leader == leader && t.second.candidate == second; });
}

void add_promising(const RankingProblem& problem, const EffectScan& scan, const SingleEffects& singles,
                   std::size_t leader, std::vector<Try>& tries) {
  for (ScannedEffect& second : promising_beside(problem, singles, scan, singles.causes[leader]))
    tries.push_back({leader, std::move(second)});
}

// Lists the leading effects without those whose fits leave the same scores as a stronger one's: what stands beside
// these stands beside that one, and complete_pairs() puts them in its place.
std::vector<std::size_t> unlike_leaders(const RankingProblem& problem, const SingleEffects& singles) {
  std::vector<std::size_t> all;
  for (const std::size_t i : leading_effects(problem, singles)) {
    const std::vector<double>& own = singles.causes[i].fit.evaluation.score;
    const auto alike = [&](std::size_t stronger) {
      const std::vector<double>& other = singles.causes[stronger].fit.evaluation.score;
      double apart = 0;
      for (std::size_t e = 0; e < own.size(); ++e) apart += (own[e] - other[e]) * (own[e] - other[e]);
      return apart < problem.rules.told_apart;
    };
    if (std::ranges::none_of(all, alike)) all.push_back(i);
  }
  return all;
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

// Fits pairs. The same pair, from either side or once more, counts once, the better fit.
void fit_pairs(const RankingProblem& problem, const SingleEffects& singles, const std::vector<Try>& tries,
               std::vector<RankedCause>& pairs) {
  std::vector<RankedCause> tried(tries.size());
  problem.model.side_by_side(tries.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    tried[i] = with_one_more(problem, singles, singles.causes[tries[i].leader], tries[i].second);
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

// Names an effect of a pair. Its values in the pair are a start for a fit of that effect alone.
struct OtherWay {
  const RankedCause* pair;
  std::size_t term;
};

// Lists the effects whose values in a pair may lie near an optimum that their own fits have missed. The first effect of
// a pair is listed where the pair gains beyond it, the second one where the two gain much more together than alone.
std::vector<OtherWay> other_ways(const RankingProblem& problem, const EffectPairs& ranked) {
  std::vector<double> gains;
  for (const RankedCause& pair : ranked.pairs) gains.push_back(std::isfinite(pair.evidence) ? pair.gain : -1);
  std::vector<OtherWay> ways;
  for (const std::size_t term : {0, 1}) {
    std::size_t found = 0;
    for (const std::size_t k : falling_order(gains)) {
      const RankedCause& pair = ranked.pairs[k];
      const RankedCause& single = ranked.singles.causes[problem.index_of(pair.terms[term].candidate)];
      if (found == most_other_ways || gains[k] < 0) break;
      if (pair.terms[term].candidate->parameters.empty() || pair.gain <= single.gain + gained_beside ||
          (term == 1 && pair.together <= problem.rules.most_together))
        continue;
      const Fit& alone = single.fitted() ? single.fit : problem.recalibrated;
      if (problem.model.evaluate(pair.fit.nuisance, std::vector{pair.terms[term]}).total() <=
          alone.log_likelihood - lost_alone)
        continue;
      ways.push_back({&pair, term});
      ++found;
    }
  }
  return ways;
}

// Fits the effects of other_ways() alone, from where the pairs have them, and takes the fits that are better.
void refit_from_pairs(const RankingProblem& problem, EffectPairs& ranked, ScansBeside& beside) {
  SingleEffects& singles = ranked.singles;
  const std::vector<OtherWay> ways = other_ways(problem, ranked);
  std::vector<Fit> again(ways.size());
  problem.model.side_by_side(ways.size(), problem.threads, [&](std::size_t k) {
    problem.heartbeat();
    again[k] = fit(problem.model, ways[k].pair->fit.nuisance, {ways[k].pair->terms[ways[k].term]},
                   {.count = {}, .refit_nuisances = true, .most_iterations = problem.effort.most_iterations});
  });
  bool any = false;
  for (std::size_t k = 0; k < again.size(); ++k) {
    const std::size_t i = problem.index_of(ways[k].pair->terms[ways[k].term].candidate);
    if (!(problem.gain(again[k]) > singles.causes[i].gain + 1)) continue;
    singles.take(problem, i, std::move(again[k]));
    beside.forget(i);
    singles.top = std::max(singles.top, singles.causes[i].evidence);
    any = true;
  }
  if (!any) return;
  for (RankedCause& pair : ranked.pairs)
    if (std::isfinite(pair.evidence))
      measure_last(problem, singles, singles.causes[problem.index_of(pair.terms[0].candidate)], pair);
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
    add_promising(problem, scan, ranked.singles, i, tries);
    // Another law has nothing to scan.
    const ScannedEffect* second = scan.find(partner);
    if (second && !is_tried(tries, i, partner)) tries.push_back({i, *second});
  }
  if (tries.empty()) return;
  for (RankedCause& pair : ranked.pairs) pair.together = gain_together(problem, ranked.singles, pair);
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
}

// Lists pairs in which another effect, about as likely alone, takes the place of one effect of a pair. The scores
// beside the partner do not show such effects: for large effects their promises differ by more than the gains do.
void add_alike_alone(const RankingProblem& problem, const EffectPairs& ranked, const EffectTerm& term,
                     const EffectTerm& partner, std::vector<Try>& tries) {
  const SingleEffects& singles = ranked.singles;
  const RankedCause& own = singles.causes[problem.index_of(term.candidate)];
  if (!own.fitted() || !(own.evidence > alike_from) || partner.candidate->parameters.empty()) return;
  for (std::size_t i = 0; i < singles.causes.size(); ++i) {
    const RankedCause& other = singles.causes[i];
    if (!other.fitted() || other.candidate_undecided() || !(other.evidence >= own.evidence - alike_margin)) continue;
    const Candidate* candidate = other.terms.front().candidate;
    if (candidate->parameters.empty() || candidate == term.candidate || candidate == partner.candidate) continue;
    if (is_tried(tries, i, partner.candidate) || is_tried(tries, problem.index_of(partner.candidate), candidate) ||
        std::ranges::any_of(ranked.pairs, [&](const RankedCause& pair) {
          return extends(pair.terms, {other.terms.front(), partner});
        }))
      continue;
    tries.push_back(
        {i, scan_effects(problem.model, other.fit, {partner.candidate}, problem.threads, {&singles.scan, candidate})
                .effects.front()});
  }
}

// Other effects may act like one of the best pair, as torques do: all that promise about as much beside the other one,
// or are about as likely alone, are fitted, so that the set names them.
void complete_pairs(const RankingProblem& problem, EffectPairs& ranked, ScansBeside& beside) {
  const RankedCause* best = near_best_pair(ranked);
  if (!best) return;
  std::vector<Try> tries;
  for (const EffectTerm& term : best->terms) {
    const std::size_t leader = problem.index_of(term.candidate);
    if (!ranked.singles.causes[leader].fitted()) continue;
    for (const ScannedEffect* effect :
         about_as_promising(problem, ranked.singles, beside.of(ranked.singles, leader), ranked.singles.causes[leader]))
      if (std::ranges::none_of(ranked.pairs, [&](const RankedCause& pair) {
            return extends(pair.terms, {term, term_at(*effect, effect->best)});
          }))
        tries.push_back({leader, *effect});
  }
  for (const std::size_t k : {0, 1}) add_alike_alone(problem, ranked, best->terms[k], best->terms[1 - k], tries);
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
}

}  // namespace

EffectPairs rank_effect_pairs(const RankingProblem& problem, SingleEffects singles, const RankingOptions& options,
                              const std::function<void()>& chosen) {
  EffectPairs ranked{std::move(singles), {}};
  ScansBeside beside(problem);
  std::vector<Try> tries;
  for (const std::size_t leader : unlike_leaders(problem, ranked.singles))
    add_promising(problem, beside.of(ranked.singles, leader), ranked.singles, leader, tries);
  add_asked_pairs(problem, ranked.singles, options.pairs, tries);
  chosen();
  fit_pairs(problem, ranked.singles, tries, ranked.pairs);
  refit_from_pairs(problem, ranked, beside);
  refine_paired(problem, ranked, beside);
  complete_pairs(problem, ranked, beside);
  finish_leading(problem, ranked.pairs);
  return ranked;
}

}  // namespace metastable::analysis
