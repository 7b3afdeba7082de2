#include "analysis/cause_ranking.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "dynamics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double expected_gain = 36;        // of an effect before its size is known
constexpr double pair_prior = 0.05;         // odds of two effects to one
constexpr double least_pair_evidence = -4;  // promised beyond the first effect's, for a pair worth fitting

// Log of the mean likelihood ratio over variants and sizes. `gain` is the fitted one of the best variant.
double log_evidence(const ScannedEffect& scanned, double gain) {
  const auto parameters = static_cast<double>(scanned.candidate->parameters.size());
  const double g = expected_gain / std::max(1.0, parameters), shrink = g / (1 + g);
  const double best = scanned.gain[scanned.best];
  double sum = 0;
  for (std::size_t v = 0; v < scanned.gain.size(); ++v) {
    const double share = v == scanned.best || !(best > 0) ? 1 : scanned.gain[v] / best;
    sum += std::exp(0.5 * shrink * gain * (std::min(1.0, share) - 1));
  }
  return 0.5 * shrink * gain + std::log(sum / static_cast<double>(scanned.gain.size())) -
         0.5 * parameters * std::log1p(g);
}

Term term_at(const ScannedEffect& scanned, std::size_t variant) {
  Term term{scanned.candidate, scanned.candidate->variants[variant], {}};
  for (std::size_t p = 0; p < scanned.candidate->parameters.size(); ++p) {
    const FreeParameter& parameter = scanned.candidate->parameters[p];
    // No further than a quarter of the range: far from the neutral value the scores say little.
    const double reach = 0.25 * (parameter.upper - parameter.lower);
    const double step = std::clamp(scanned.start[variant][static_cast<Eigen::Index>(p)], -reach, reach);
    term.values.push_back(std::clamp(parameter.neutral + step, parameter.lower, parameter.upper));
  }
  return term;
}

// Variants worth a full fit.
std::vector<std::size_t> leading_variants(const ScannedEffect& scanned) {
  std::vector<std::size_t> order(scanned.gain.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return scanned.gain[a] > scanned.gain[b]; });
  std::vector<std::size_t> leading;
  for (const std::size_t v : order)
    if (leading.empty() ||
        (leading.size() < 3 && scanned.gain[v] > 8 && scanned.gain[v] > 0.8 * scanned.gain[order[0]]))
      leading.push_back(v);
  return leading;
}

// Moves the last term's variant between the list's values as long as the likelihood rises, halving the moves.
void refine_variant(const TransitionModel& model, Fit& best) {
  const std::vector<double> spacing = best.terms.back().candidate->refine;
  double share = 0.5;
  for (int round = 0; round < 3; ++round, share /= 2)
    for (std::size_t entry = 0; entry < spacing.size(); ++entry) {
      if (spacing[entry] == 0) continue;
      for (const double sign : {1.0, -1.0}) {
        std::vector<Term> terms = best.terms;
        terms.back().variant[entry] += sign * share * spacing[entry];
        Fit tried = fit(model, best.nuisance, terms, {.count = {}, .refit_nuisances = true, .most_iterations = 4});
        if (!(tried.penalised > best.penalised + 0.2)) continue;
        const bool was_converged = best.converged;
        best = std::move(tried);
        best.converged = best.converged || was_converged;
        break;
      }
    }
}

// The best fit of `base` with one more effect.
RankedCause fit_cause(const TransitionModel& model, const Fit& base, const ScannedEffect& scanned) {
  RankedCause cause;
  bool first = true;
  for (const std::size_t variant : leading_variants(scanned)) {
    std::vector<Term> terms = base.terms;
    terms.push_back(term_at(scanned, variant));
    Fit tried = fit(model, base.nuisance, terms);
    if (tried.penalised < base.penalised) {  // a bad start: from nothing instead
      for (std::size_t p = 0; p < terms.back().values.size(); ++p) {
        const FreeParameter& parameter = scanned.candidate->parameters[p];
        terms.back().values[p] = parameter.try_at != 0 ? parameter.try_at * 0.1 : parameter.neutral;
      }
      Fit again = fit(model, base.nuisance, terms);
      if (again.penalised > tried.penalised) tried = std::move(again);
    }
    if (first || tried.penalised > cause.fit.penalised) cause.fit = std::move(tried);
    first = false;
  }
  cause.terms = cause.fit.terms;
  if (!cause.fit.converged) cause.not_decided = cause.fit.reason;
  return cause;
}

// What a second effect gained beyond the model error of the first. `exact`: the part of the first that has none.
double earned(const TransitionModel& model, const Fit& pair, const Fit& first, const Fit& exact) {
  const PhaseGain before = phase_gain(model, first, exact), now = phase_gain(model, pair, first);
  const double tolerated = model_error * model_error;
  // Only what the second effect gained by itself: one phase may have paid for the other.
  const double all = now.collisions + now.stances;
  const double beyond = std::max(0.0, now.collisions - tolerated * std::max(0.0, before.collisions)) +
                        std::max(0.0, now.stances - tolerated * std::max(0.0, before.stances));
  return std::max(0.0, std::min(all, beyond));
}

}  // namespace

PhaseGain phase_gain(const TransitionModel& model, const Fit& better, const Fit& worse) {
  PhaseGain gain;
  for (std::size_t i = 0; i < model.events().size(); ++i)
    (model.events()[i].kind == EventKind::stance ? gain.stances : gain.collisions) +=
        2 * (better.evaluation.log_density[i] - worse.evaluation.log_density[i]);
  return gain;
}

const Fit& exact_part(const std::vector<RankedCause>& singles, const std::vector<Term>& terms,
                      const Fit& recalibrated) {
  for (const Term& term : terms)
    for (const RankedCause& cause : singles)
      if (term.candidate->exact && cause.terms[0].candidate == term.candidate && !cause.fit.nuisance.empty())
        return cause.fit;
  return recalibrated;
}

CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options) {
  const auto progress = [&](double share) {
    if (options.progress) options.progress(share);
  };
  CauseRanking ranking;
  ranking.scan = scan_effects(model, recalibrated, candidates, options.threads);
  progress(0.15);
  const ChanceGains chance(ranking.scan, options.draws, options.seed);

  double largest = 0;
  for (const ScannedEffect& effect : ranking.scan.effects) largest = std::max(largest, effect.gain[effect.best]);

  ranking.singles.resize(candidates.size());
  const auto scanned_of = [&](const EffectScan& scan, const Candidate* candidate) -> const ScannedEffect* {
    for (const ScannedEffect& effect : scan.effects)
      if (effect.candidate == candidate) return &effect;
    return nullptr;
  };
  markov::parallel_for(candidates.size(), options.threads, [&](std::size_t i) {
    const Candidate* candidate = candidates[i];
    RankedCause& cause = ranking.singles[i];
    cause.terms = {Term{candidate, candidate->variants[0], {}}};
    if (!candidate->undecidable.empty()) {
      cause.not_decided = candidate->undecidable;
      cause.evidence = -std::numeric_limits<double>::infinity();
      return;
    }
    if (candidate->parameters.empty()) {  // another law: nothing to scan
      // Contact parameters that suit one law mislead under the other: the nominal ones are a start, too.
      const auto from = [&](const std::vector<double>& nuisance, int iterations) {
        return fit(model, nuisance, cause.terms, {.count = {}, .refit_nuisances = true, .most_iterations = iterations});
      };
      cause.fit = from(nominal_values(model), 12);
      Fit other = from(recalibrated.nuisance, 12);
      if (other.penalised > cause.fit.penalised) cause.fit = std::move(other);
      if (!cause.fit.converged && cause.fit.penalised - recalibrated.penalised > -100)
        cause.fit = from(cause.fit.nuisance, 60);
      cause.gain = 2 * (cause.fit.penalised - recalibrated.penalised);
      // Far below and hardly rising any more: decided against.
      if (!cause.fit.converged && cause.gain > -30) cause.not_decided = cause.fit.reason;
      cause.p_value = 2 * dynamics::normal_cdf(-std::sqrt(std::max(0.0, cause.gain)));
      cause.evidence = 0.5 * cause.gain;
      return;
    }
    const ScannedEffect& scanned = *scanned_of(ranking.scan, candidate);
    const double promised = scanned.gain[scanned.best];
    if (promised < 2 || promised < 0.2 * largest - 40) {  // far behind: the scores say enough
      cause.gain = promised;
      cause.evidence = log_evidence(scanned, promised);
      cause.terms = {term_at(scanned, scanned.best)};
      for (std::size_t e = 0; e < ranking.scan.effects.size(); ++e)
        if (ranking.scan.effects[e].candidate == candidate) cause.p_value = chance.p_value(e, promised);
      return;
    }
    cause = fit_cause(model, recalibrated, scanned);
    cause.gain = 2 * (cause.fit.penalised - recalibrated.penalised);
    // At the optimum up to what the differences resolve: small gains that the scores confirm are decided.
    if (!cause.not_decided.empty() && cause.gain < 10 && scanned.gain[scanned.best] < 10) cause.not_decided.clear();
    for (std::size_t e = 0; e < ranking.scan.effects.size(); ++e)
      if (ranking.scan.effects[e].candidate == candidate) cause.p_value = chance.p_value(e, cause.gain);
    cause.evidence = log_evidence(scanned, std::max(0.0, cause.gain));
  });
  // Scores promise too much now and then: whoever would come near the fitted ones is fitted after all.
  double fitted = 0;
  for (const RankedCause& cause : ranking.singles)
    if (!cause.fit.nuisance.empty()) fitted = std::max(fitted, cause.evidence);
  markov::parallel_for(ranking.singles.size(), options.threads, [&](std::size_t i) {
    RankedCause& cause = ranking.singles[i];
    if (cause.candidate_undecided() || !cause.fit.nuisance.empty() || cause.evidence < std::max(0.0, fitted - 12))
      return;
    const ScannedEffect& scanned = *scanned_of(ranking.scan, candidates[i]);
    cause = fit_cause(model, recalibrated, scanned);
    cause.gain = 2 * (cause.fit.penalised - recalibrated.penalised);
    for (std::size_t e = 0; e < ranking.scan.effects.size(); ++e)
      if (ranking.scan.effects[e].candidate == candidates[i]) cause.p_value = chance.p_value(e, cause.gain);
    cause.evidence = log_evidence(scanned, std::max(0.0, cause.gain));
  });
  progress(0.5);
  double least = 1, top = 0;
  std::vector<std::size_t> strongest;
  for (std::size_t i = 0; i < ranking.singles.size(); ++i) {
    const RankedCause& cause = ranking.singles[i];
    if (cause.candidate_undecided()) continue;
    least = std::min(least, cause.p_value);
    top = std::max(top, cause.evidence);
    if (cause.evidence > 2 && !cause.fit.nuisance.empty() && !cause.terms[0].candidate->refine.empty())
      strongest.push_back(i);
  }
  std::sort(strongest.begin(), strongest.end(),
            [&](std::size_t a, std::size_t b) { return ranking.singles[a].evidence > ranking.singles[b].evidence; });
  if (strongest.size() > 3) strongest.resize(3);
  markov::parallel_for(strongest.size(), options.threads, [&](std::size_t k) {
    RankedCause& cause = ranking.singles[strongest[k]];
    if (cause.evidence < 0.7 * top - 10) return;
    refine_variant(model, cause.fit);
    const double gain = 2 * (cause.fit.penalised - recalibrated.penalised);
    cause.evidence += 0.5 * (gain - cause.gain);
    cause.gain = gain;
    cause.terms = cause.fit.terms;
  });
  // Where a fit did not settle near the top: once more, from the nuisances that suit the leader.
  const auto best_single =
      std::max_element(ranking.singles.begin(), ranking.singles.end(),
                       [](const RankedCause& a, const RankedCause& b) { return a.evidence < b.evidence; });
  markov::parallel_for(ranking.singles.size(), options.threads, [&](std::size_t i) {
    RankedCause& cause = ranking.singles[i];
    if (&cause == &*best_single || cause.fit.converged || cause.fit.nuisance.empty() ||
        best_single->fit.nuisance.empty() || cause.evidence < top - 60)
      return;
    Fit again = fit(model, best_single->fit.nuisance, cause.terms);
    if (!(again.penalised > cause.fit.penalised)) return;
    const double gain = 2 * (again.penalised - recalibrated.penalised);
    cause.evidence += 0.5 * (gain - cause.gain);
    cause.gain = gain;
    cause.fit = std::move(again);
    cause.terms = cause.fit.terms;
    if (cause.fit.converged) cause.not_decided.clear();
  });
  // A fit that did not settle is decided where all it could still rise leaves it far behind, or is next to nothing.
  for (RankedCause& cause : ranking.singles)
    if (!cause.candidate_undecided() && !cause.fit.nuisance.empty() &&
        (cause.evidence + 3 * cause.fit.promised < top - 12 || cause.fit.promised < 2 + 1e-3 * cause.gain))
      cause.not_decided.clear();
  progress(0.6);
  ranking.p_value = chance.look_elsewhere(least);

  // Pairs: what the leaders leave, scanned again.
  std::vector<std::size_t> leaders;
  for (std::size_t i = 0; i < ranking.singles.size(); ++i)
    if (ranking.singles[i].evidence > 2 && !ranking.singles[i].fit.nuisance.empty()) leaders.push_back(i);
  std::sort(leaders.begin(), leaders.end(),
            [&](std::size_t a, std::size_t b) { return ranking.singles[a].evidence > ranking.singles[b].evidence; });
  if (leaders.size() > 3) leaders.resize(3);
  const double prior = std::log(pair_prior / std::max(1.0, 0.5 * static_cast<double>(candidates.size() - 1)));
  struct Try {
    std::size_t leader;
    ScannedEffect scanned;
  };
  std::vector<Try> tries;
  for (const std::size_t leader : leaders) {
    const RankedCause& first = ranking.singles[leader];
    std::vector<const Candidate*> others;
    for (const Candidate* other : candidates)
      if (other != first.terms[0].candidate) others.push_back(other);
    const EffectScan scan = scan_effects(model, first.fit, others, options.threads);
    std::vector<std::pair<double, const ScannedEffect*>> promising;
    for (const ScannedEffect& effect : scan.effects) {
      const double promised = log_evidence(effect, effect.gain[effect.best]);
      if (promised + prior > least_pair_evidence) promising.emplace_back(promised, &effect);
    }
    std::sort(promising.begin(), promising.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    for (std::size_t k = 0; k < std::min<std::size_t>(3, promising.size()); ++k)
      tries.push_back({leader, *promising[k].second});
  }
  progress(0.8);
  std::vector<RankedCause> pairs(tries.size());
  markov::parallel_for(tries.size(), options.threads, [&](std::size_t i) {
    const RankedCause& first = ranking.singles[tries[i].leader];
    RankedCause& pair = pairs[i];
    pair = fit_cause(model, first.fit, tries[i].scanned);
    pair.gain = 2 * (pair.fit.penalised - recalibrated.penalised);
    const double second = earned(model, pair.fit, first.fit, exact_part(ranking.singles, first.terms, recalibrated));
    pair.evidence = first.evidence + log_evidence(tries[i].scanned, second) + prior;
    pair.p_value = 2 * dynamics::normal_cdf(-std::sqrt(second));
  });
  // The same pair from either side counts once, the better fit.
  for (RankedCause& pair : pairs) {
    const auto same = std::find_if(ranking.pairs.begin(), ranking.pairs.end(), [&](const RankedCause& other) {
      return (other.terms[0].candidate == pair.terms[1].candidate &&
              other.terms[1].candidate == pair.terms[0].candidate);
    });
    if (same == ranking.pairs.end())
      ranking.pairs.push_back(std::move(pair));
    else if (pair.evidence > same->evidence)
      *same = std::move(pair);
  }
  progress(1);
  return ranking;
}

}  // namespace metastable::analysis
