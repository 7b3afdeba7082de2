#include "analysis/fitting/single_effects.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/statistics/falling_order.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// These numbers save time: they say which effects are fitted, the others are weighed by what their scores promise.
constexpr double promise_share = 0.2;     // of the largest promised gain, less
constexpr double promise_margin = 40;     //   this much
constexpr double overlooked_margin = 12;  // evidence by the scores below the best fitted one, for a fit after all
constexpr double leader_evidence = 2;     // of an effect that is refined, and that pairs are built on
// An effect is refined, or its fit started anew, where its evidence is this share of the best, less near_margin.
constexpr double refined_share = 0.4, restarted_share = 0.7, near_margin = 10;
constexpr double refit_margin = 60;  // evidence below the best, for a fit that did not converge to be tried again

// These numbers say how fits are run.
constexpr int law_steps = 12;          // of another law's fit, from either start
constexpr int more_law_steps = 60;     // where it may still come near
constexpr int more_steps = 4;          // times as many, where a fit near the top did not converge
constexpr double law_hopeless = -100;  // log likelihood below the recalibrated model's that no more steps make good
constexpr double strained = 2;         // cost of its priors [log likelihood], for a fit to be tried from what is stated

// These numbers say when a fit that did not converge is decided all the same.
constexpr double law_refuted = -30;     // gain of another law: so far below that what it could still rise is nothing
constexpr double small_gain = 10;       // by fit and by scores: at the optimum up to what differences resolve
constexpr double rise_weight = 3;       // of the rise that the slope still promises, as evidence, and
constexpr double far_behind = 12;       //   evidence below the best that it leaves
constexpr double next_to_nothing = 2;   // promised rise of the log likelihood, plus
constexpr double share_of_gain = 1e-3;  //   this share of the gain

// Another law has nothing to scan. Contact parameters that suit one law mislead under the other: the nominal ones are a
// start, too.
void fit_law(const RankingProblem& problem, const SingleEffects& singles, RankedCause& cause) {
  const auto from = [&](const std::vector<double>& nuisance, int iterations) {
    return fit(problem.model, nuisance, cause.terms,
               {.count = {}, .refit_nuisances = true, .most_iterations = iterations});
  };
  cause.fit = from(nominal_values(problem.model), law_steps);
  Fit other = from(problem.recalibrated.nuisance, law_steps);
  if (other.penalised > cause.fit.penalised) cause.fit = std::move(other);
  if (!cause.fit.converged && cause.fit.penalised - problem.recalibrated.penalised > law_hopeless)
    cause.fit = from(cause.fit.nuisance, std::min(more_law_steps, 4 * problem.effort.most_iterations));
  cause.gain = problem.gain(cause.fit);
  // A law that is far below and hardly rises any more is decided against.
  if (!cause.fit.converged && cause.gain > law_refuted) cause.not_decided = cause.fit.reason;
  cause.p_value = singles.p_value(cause.terms[0].candidate, cause.gain);
  cause.evidence = 0.5 * cause.gain;
}

// Fits and weighs one candidate, or weighs it by its scores where these promise far too little.
RankedCause weighed_effect(const RankingProblem& problem, const SingleEffects& singles, const Candidate* candidate,
                           double largest) {
  RankedCause cause;
  cause.terms = {EffectTerm{candidate, candidate->variants[0], {}}};
  if (!candidate->undecidable.empty()) {
    cause.not_decided = candidate->undecidable;
    cause.evidence = -std::numeric_limits<double>::infinity();
    return cause;
  }
  if (candidate->parameters.empty()) {
    fit_law(problem, singles, cause);
    return cause;
  }
  const ScannedEffect& scanned = *singles.scan.find(candidate);
  const double promised = scanned.gain[scanned.best];
  // The scores do not decide where the model itself knows better starts.
  if (!problem.model.starts(std::vector{term_at(scanned, scanned.best)}).empty() ||
      (promised >= problem.effort.least_promise && promised >= promise_share * largest - promise_margin))
    return fitted_effect(problem, singles, scanned);
  cause.gain = promised;
  cause.evidence = evidence_of(scanned, promised, problem.rules);
  cause.terms = {term_at(scanned, scanned.best)};
  cause.p_value = singles.p_value(candidate, promised);
  return cause;
}

void fit_all(const RankingProblem& problem, SingleEffects& singles) {
  double largest = 0;
  for (const ScannedEffect& effect : singles.scan.effects) largest = std::max(largest, effect.gain[effect.best]);
  problem.model.side_by_side(problem.candidates.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    singles.causes[i] = weighed_effect(problem, singles, problem.candidates[i], largest);
  });
}

// Scores promise too much now and then: whoever would come near the fitted ones is fitted after all.
void fit_overlooked(const RankingProblem& problem, SingleEffects& singles) {
  double best = 0;
  for (const RankedCause& cause : singles.causes)
    if (cause.fitted()) best = std::max(best, cause.evidence);
  problem.model.side_by_side(singles.causes.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    RankedCause& cause = singles.causes[i];
    if (cause.candidate_undecided() || cause.fitted() || cause.evidence < std::max(0.0, best - overlooked_margin))
      return;
    cause = fitted_effect(problem, singles, *singles.scan.find(problem.candidates[i]));
  });
  for (const RankedCause& cause : singles.causes)
    if (!cause.candidate_undecided()) singles.least_p = std::min(singles.least_p, cause.p_value);
  singles.update_top();
}

bool near_the_top(const SingleEffects& singles, const RankedCause& cause, double share) {
  return cause.evidence >= share * singles.top - near_margin;
}

// A recalibration that took a large effect up may hold the effect's own fit off its optimum, so that the nuisances are
// strained: fits start from the stated nuisances, too.
void refit_from_stated(const RankingProblem& problem, SingleEffects& singles) {
  const std::vector<double> stated = nominal_values(problem.model);
  problem.model.side_by_side(singles.causes.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    RankedCause& cause = singles.causes[i];
    if (!cause.fitted() || cause.terms[0].candidate->parameters.empty() ||
        !near_the_top(singles, cause, restarted_share) || cause.fit.log_likelihood - cause.fit.penalised < strained)
      return;
    FitOptions options{.count = {}, .refit_nuisances = true, .most_iterations = problem.effort.most_iterations};
    options.to_beat = cause.fit.penalised;
    Fit other = fit(problem.model, stated, cause.terms, options);
    if (other.penalised > cause.fit.penalised) singles.take(problem, i, std::move(other));
  });
  singles.update_top();
}

// Fits once more where a fit did not converge near the top: further along its own way, and from the nuisances that suit
// the leader.
void refit_unconverged(const RankingProblem& problem, SingleEffects& singles) {
  if (singles.causes.empty()) return;
  const auto best = std::ranges::max_element(singles.causes, {}, &RankedCause::evidence);
  const std::vector<double> leaders_nuisance = best->fit.nuisance;
  problem.model.side_by_side(singles.causes.size(), problem.threads, [&](std::size_t i) {
    problem.heartbeat();
    const RankedCause& cause = singles.causes[i];
    if (cause.fit.converged || !cause.fitted() || leaders_nuisance.empty() ||
        cause.evidence < singles.top - refit_margin)
      return;
    const auto fit_from = [&](const std::vector<double>& nuisance, int times) {
      return fit(problem.model, nuisance, cause.terms,
                 {.count = {}, .refit_nuisances = true, .most_iterations = times * problem.effort.most_iterations});
    };
    Fit again = fit_from(cause.fit.nuisance, more_steps);
    if (!again.converged && &cause != &*best)
      if (Fit other = fit_from(leaders_nuisance, 1); other.penalised > again.penalised) again = std::move(other);
    if (again.penalised > cause.fit.penalised) singles.take(problem, i, std::move(again));
  });
  singles.update_top();
}

// A fit that did not converge is decided where all it could still rise leaves it far behind, or is next to nothing.
void decide_unconverged(SingleEffects& singles) {
  for (RankedCause& cause : singles.causes)
    if (!cause.candidate_undecided() && cause.fitted() && std::isfinite(cause.evidence) &&
        (cause.evidence + rise_weight * cause.fit.promised < singles.top - far_behind ||
         cause.fit.promised < next_to_nothing + share_of_gain * cause.gain))
      cause.not_decided.clear();
}

// Credits an effect with what another one with more parameters gains beyond it, as far as that is no more than an error
// of its form. Eight leg lengths, for instance, follow an eccentric hub closer than the catalogue's form of a hub does.
void forgive_form(const RankingProblem& problem, SingleEffects& singles) {
  const auto parameters = [](const RankedCause& cause) { return cause.terms[0].candidate->parameters.size(); };
  const auto comparable = [&](const RankedCause& cause) {
    return cause.fitted() && std::isfinite(cause.evidence) && parameters(cause) > 0;
  };
  for (RankedCause& cause : singles.causes) {
    if (!comparable(cause)) continue;
    const Fit& exact = exact_part(singles.causes, cause.terms, problem.recalibrated);
    double forgiven = 0;
    for (const RankedCause& larger : singles.causes)
      if (comparable(larger) && parameters(larger) > parameters(cause) && larger.gain > cause.gain)
        forgiven = std::max(
            forgiven, larger.gain - cause.gain - earned(problem.model, larger.fit, cause.fit, exact, problem.rules));
    const auto count = static_cast<double>(parameters(cause));
    cause.evidence += evidence_of_gain(cause.gain + forgiven, count, problem.rules) -
                      evidence_of_gain(cause.gain, count, problem.rules);
  }
  singles.update_top();
}

// Lists the strongest fitted effects for which `wanted` holds, by falling evidence.
template <class Wanted>
std::vector<std::size_t> strongest(const RankingProblem& problem, const SingleEffects& singles, Wanted wanted) {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < singles.causes.size(); ++i)
    if (singles.causes[i].evidence > leader_evidence && singles.causes[i].fitted() && wanted(singles.causes[i]))
      all.push_back(i);
  std::vector<double> evidence;
  for (const std::size_t i : all) evidence.push_back(singles.causes[i].evidence);
  std::vector<std::size_t> ordered;
  for (const std::size_t k : falling_order(evidence)) ordered.push_back(all[k]);
  all = std::move(ordered);
  if (all.size() > problem.effort.most_leaders) all.resize(problem.effort.most_leaders);
  return all;
}

void refine_leaders(const RankingProblem& problem, SingleEffects& singles) {
  const std::vector<std::size_t> leaders =
      strongest(problem, singles, [](const RankedCause& cause) { return !cause.terms[0].candidate->refine.empty(); });
  problem.model.side_by_side(leaders.size(), problem.threads, [&](std::size_t k) {
    problem.heartbeat();
    if (near_the_top(singles, singles.causes[leaders[k]], refined_share)) refine_effect(problem, singles, leaders[k]);
  });
}

}  // namespace

double SingleEffects::p_value(const Candidate* candidate, double gain) const {
  if (candidate->parameters.empty()) return 2 * dynamics::normal_cdf(-std::sqrt(std::max(0.0, gain)));
  return chance.p_value(candidate, gain);
}

void SingleEffects::take(const RankingProblem& problem, std::size_t i, Fit better) {
  RankedCause& cause = causes[i];
  cause.not_decided = better.converged ? "" : better.reason;
  cause.take(std::move(better), problem.recalibrated);
  if (!refined[i]) cause.p_value = p_value(cause.terms[0].candidate, cause.gain);
}

void SingleEffects::update_top() {
  for (const RankedCause& cause : causes)
    if (!cause.candidate_undecided()) top = std::max(top, cause.evidence);
}

RankedCause fitted_effect(const RankingProblem& problem, const SingleEffects& singles, const ScannedEffect& scanned) {
  RankedCause cause =
      as_cause(fit_one_more(problem.model, problem.effort, problem.recalibrated, scanned), problem.recalibrated);
  if (!std::isfinite(cause.evidence)) return cause;
  // These are at the optimum up to what the differences resolve: small gains that the scores confirm are decided.
  if (cause.gain < small_gain && scanned.gain[scanned.best] < small_gain) cause.not_decided.clear();
  cause.p_value = singles.p_value(scanned.candidate, cause.gain);
  cause.evidence = evidence_of(scanned, std::max(0.0, cause.gain), problem.rules);
  return cause;
}

void refine_effect(const RankingProblem& problem, SingleEffects& singles, std::size_t i) {
  Fit better = singles.causes[i].fit;
  refine_variant(problem.model, problem.effort, better);
  singles.causes[i].take(std::move(better), problem.recalibrated);
  singles.refined[i] = true;
}

std::vector<std::size_t> leading_effects(const RankingProblem& problem, const SingleEffects& singles) {
  std::vector<std::size_t> all = strongest(problem, singles, [](const RankedCause&) { return true; });
  double best = 0;
  for (const std::size_t i : all)
    if (singles.causes[i].not_decided.empty()) best = std::max(best, singles.causes[i].gain);
  std::erase_if(all, [&](std::size_t i) { return pair_share * singles.causes[i].gain + pair_margin < best; });
  return all;
}

SingleEffects rank_single_effects(const RankingProblem& problem, const RankingOptions& options,
                                  const std::function<void()>& halfway) {
  EffectScan scan = scan_effects(problem.model, problem.recalibrated, problem.candidates, problem.threads);
  ChanceGains chance(scan, options.draws, options.seed);
  SingleEffects singles{std::move(scan), std::move(chance), std::vector<RankedCause>(problem.candidates.size()),
                        std::vector<char>(problem.candidates.size())};
  fit_all(problem, singles);
  fit_overlooked(problem, singles);
  halfway();
  refit_from_stated(problem, singles);
  refine_leaders(problem, singles);
  refit_unconverged(problem, singles);
  decide_unconverged(singles);
  forgive_form(problem, singles);
  return singles;
}

}  // namespace metastable::analysis
