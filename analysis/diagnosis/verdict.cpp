#include "analysis/diagnosis/verdict.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "analysis/diagnosis/at_work.h"
#include "analysis/diagnosis/parameter_estimates.h"
#include "analysis/diagnosis/too_few.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/evidence.h"
#include "analysis/gap/gap_map.h"
#include "analysis/gap/left_over.h"

namespace metastable::analysis {
namespace {

constexpr double recalibration_level = 0.02;

// These levels say what the best hypothesis may leave before none of all is believed.
constexpr double left_over_level = 0.003;  // of the map's p-value
constexpr double left_over_square = 15;    // of a cell's statistic, beyond the model error
constexpr double least_left_over = 0.05;   // held-out gap that counts as one [nats a collision]
constexpr double least_left_in_all = 6;    //   or that no draw of the trials takes away [nats, all collisions]
constexpr double left_over_errors = 6;     // squared model errors of the gap as given that count as none, held out
constexpr double facet_errors = 3;         // squared model errors that may be spread over the cells of a facet
constexpr double largest_log_odds = 300;   // of none: their exponential stays finite
constexpr std::size_t most_beside = 3;  // hypotheses beside which it is supposed, the recalibrated model not counted,
constexpr double beside_margin = 12;    //   whose evidence is no further behind the best

// These numbers are of odds and sets.
constexpr double most_odds_of_none = 0.25;  // to all effects, for a name to be given
constexpr double none_prior = 0.01;         // odds of none to a gap where nothing is left over
constexpr double set_share = 0.95;          // of what the effects share that the set holds
constexpr double least_of_first = 0.05;  // one less likely than this share of the first is not named for completeness
constexpr double told_apart = 6;         // 2 Delta log likelihood that makes odds of 20 to 1

// Says whether a hypothesis has all effects of another one.
bool extends(const RankedCause& cause, const RankedCause& other) {
  return std::ranges::all_of(other.terms, [&](const EffectTerm& wanted) {
    return std::ranges::any_of(cause.terms, [&](const EffectTerm& term) { return term.candidate == wanted.candidate; });
  });
}

// Says whether a hypothesis adds an effect to a likelier one: what it leaves is then the likelier one's to leave.
bool extends_likelier(const RankedCause& cause, const std::vector<const RankedCause*>& ordered) {
  for (const RankedCause* likelier : ordered) {
    if (likelier == &cause) return false;
    if (extends(cause, *likelier)) return true;
  }
  return false;
}

// Supposes something without a name alone and beside the likeliest hypotheses. Returns its odds; few trials cannot show
// that events scatter as they would by themselves, and facets are then not judged.
Odds odds_of_unnamed(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
                     const std::vector<const RankedCause*>& ordered, const Fit& recalibrated) {
  if (!ranking.scan.trials_suffice) return {};
  const double top = ordered.front()->evidence;
  double all = 0;
  std::vector<const RankedCause*> joined;  // hypotheses beside which it is supposed
  std::vector<Unnamed> unnamed;            // beside each of them
  for (const RankedCause* cause : ordered) {
    all += std::exp(cause->evidence - top);
    if (joined.size() == most_beside || cause->evidence < top - beside_margin) continue;
    if (cause->fit.nuisance.empty() || extends_likelier(*cause, ordered)) continue;
    const PhaseGain gained = phase_gain(model, cause->fit, exact_part(ranking.singles, cause->terms, recalibrated));
    constexpr double tolerated = facet_errors * model_error * model_error;
    Unnamed one{{},
                cause->evidence,
                left_by_facet(model, cause->fit, tolerated * gained.collisions, tolerated * gained.stances)};
    for (const EffectTerm& term : cause->terms) one.beside.push_back(term.candidate->id);
    joined.push_back(cause);
    unnamed.push_back(std::move(one));
  }
  // What has no name gains no more beside one effect than both of a pair do, and what these leave.
  Unnamed& alone = d.causes.unnamed.front();
  double of_joined = 0, beside = 0;
  for (std::size_t i = 0; i < joined.size(); ++i) {
    bound_evidence(alone.facets, joined[i]->gain, unnamed[i].facets);
    for (std::size_t k = 0; k < joined.size(); ++k)
      if (k != i && extends(*joined[k], *joined[i]))
        bound_evidence(unnamed[i].facets, joined[k]->gain - joined[i]->gain, unnamed[k].facets);
    unnamed[i].evidence += evidence_of_more(unnamed[i].facets);
    of_joined += std::exp(joined[i]->evidence - top);
    beside += std::exp(std::min(largest_log_odds, unnamed[i].evidence - top));
  }
  alone.evidence = evidence_of_more(alone.facets);
  const Odds odds{unnamed_alone * std::exp(std::min(largest_log_odds, alone.evidence - top)) / all,
                  of_joined > 0 ? unnamed_beside * beside / of_joined : 0};
  std::ranges::move(unnamed, std::back_inserter(d.causes.unnamed));
  return odds;
}

// Says whether the design itself cannot tell two effects apart where the first of them gains that much.
bool acts_alike(const Diagnosis& d, const std::string& effect, const std::string& other, double gain) {
  const auto seen = std::ranges::find(d.limits.visible, effect, &Visibility::effect);
  if (seen == d.limits.visible.end()) return false;
  const auto share = std::ranges::find(seen->alike, other, &std::pair<std::string, double>::first);
  return share != seen->alike.end() && (1 - share->second) * gain < told_apart;
}

// Lists what the design itself cannot tell from the first of the set. Of a pair one effect may be another one, with
// what it gains beside its partner.
void list_alike(Diagnosis& d) {
  const std::vector<Cause>& ranked = d.causes.ranked;
  const Cause& first = ranked.front();
  const auto gain_of = [&](const std::string& name) {
    const auto cause = std::ranges::find(ranked, name, &Cause::name);
    return cause == ranked.end() ? 0 : cause->gain;
  };
  const auto alike_to_first = [&](const std::string& name) {
    if (first.effects.size() == 1) return acts_alike(d, first.name(), name, first.gain);
    const auto other = std::ranges::find(ranked, name, &Cause::name);
    if (other == ranked.end() || other->effects.size() != 2) return false;
    for (const std::size_t own : {0, 1})
      for (const std::size_t theirs : {0, 1})
        if (first.effects[1 - own] == other->effects[1 - theirs] &&
            acts_alike(d, first.effects[own], other->effects[theirs], first.gain - gain_of(first.effects[1 - own])))
          return true;
    return false;
  };
  std::vector<std::string> alike;
  for (const std::string& name : d.causes.set)
    if (name == first.name() || alike_to_first(name)) alike.push_back(name);
  if (alike.size() > 1) d.causes.alike = std::move(alike);
}

}  // namespace

std::vector<const RankedCause*> hypotheses(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking) {
  std::vector<const RankedCause*> ordered;
  for (const RankedCause& cause : ranking.singles) {
    if (cause.not_decided.empty())
      ordered.push_back(&cause);
    else
      d.causes.not_decided.push_back(described_cause(model, cause, ranking.scan));
  }
  for (const RankedCause& pair : ranking.pairs) {
    if (std::isfinite(pair.evidence))
      ordered.push_back(&pair);
    else
      d.causes.not_decided.push_back(described_cause(model, pair, ranking.scan));
  }
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const RankedCause* a, const RankedCause* b) { return a->evidence > b->evidence; });
  return ordered;
}

Chosen choose(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
              const std::vector<const RankedCause*>& ordered, const Fit& recalibrated,
              const DiagnosisOptions& options) {
  const RankedCause& best = *ordered.front();
  Chosen chosen{&best.fit, {}};
  d.gap.left = gap_map(model, best.fit, options.draws, options.seed + 1);
  const Fit& exact = exact_part(ranking.singles, best.terms, recalibrated);
  PhaseGain gained = phase_gain(model, best.fit, exact);
  if (model.refits_noise()) {  // how large the effect is beside the noise that it leaves, not beside what swallowed it
    Fit without;
    without.evaluation = model.evaluate(best.fit.nuisance, {});
    gained = phase_gain(model, best.fit, without);
  }
  const double all = best.fit.log_likelihood - recalibrated.log_likelihood;
  if (all > 0) chosen.bent = std::clamp((best.fit.log_likelihood - exact.log_likelihood) / all, 0.0, 1.0);
  const double tolerated = model_error * model_error;
  const double beyond = d.gap.left.largest_beyond(tolerated * gained.collisions, tolerated * gained.stances);
  chosen.unnamed = odds_of_unnamed(d, model, ranking, ordered, recalibrated);
  double& left = chosen.unnamed.left;
  if (d.gap.left.p_value < left_over_level && beyond > left_over_square)
    left = std::exp(std::min(largest_log_odds, 0.5 * (beyond - left_over_square)));
  d.causes.together = best.together;
  if (d.causes.together > surely_bent)
    chosen.unnamed.alone = std::max(chosen.unnamed.alone, certain_odds);
  else if (d.causes.together > most_together)
    left = std::max(left, even_odds);
  return chosen;
}

bool leaves_gap_held_out(const Diagnosis& d, double bent, double by_itself) {
  const Shrinkage& log_score = d.shrinkage.measures.front();
  const double left = log_score.with_effect - by_itself;
  const double tolerated = model_error * model_error * left_over_errors * bent * log_score.baseline;
  if (left > least_left_over + tolerated) return true;
  return d.data.trials >= enough_trials && log_score.with_effect_least > tolerated + by_itself &&
         left * static_cast<double>(d.data.collisions) > least_left_in_all;
}

double share_probabilities(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
                           const std::vector<const RankedCause*>& ordered, std::size_t candidates, bool gap,
                           const Odds& unnamed) {
  const double top = ordered.empty() ? 0 : std::max(0.0, ordered.front()->evidence);
  const double effects = std::max<double>(1, static_cast<double>(candidates));
  const double weight_null = std::exp(-top);
  double given_gap = 0;
  for (const RankedCause* cause : ordered) given_gap += std::exp(cause->evidence - top) / effects;
  // The tests decide whether there is a gap, because their levels are calibrated and the evidence's are not: where both
  // disagree, the odds of a gap go no further than even.
  const double none = std::max(unnamed.none(), none_prior);
  const double even = weight_null / (1 + none);
  double share = 1;
  if (given_gap > 0 && (gap ? given_gap < even : given_gap > even)) share = even / given_gap;
  const double weight_none = none * (given_gap > 0 ? share * given_gap : even);
  const double sum = weight_null + share * given_gap + weight_none;
  d.causes.p_none = weight_none / sum;
  (d.gap.p_recalibration < recalibration_level ? d.causes.p_recalibrate : d.causes.p_no_gap) = weight_null / sum;
  for (const RankedCause* cause : ordered) {
    Cause one = described_cause(model, *cause, ranking.scan);
    one.probability = share * std::exp(cause->evidence - top) / effects / sum;
    d.causes.ranked.push_back(std::move(one));
  }
  return share * given_gap / sum;
}

void give_verdict(Diagnosis& d, bool gap, const Odds& unnamed, double share_of_effects) {
  if (trials_to_explain(d)) {
    const bool any = gap || d.gap.p_recalibration < recalibration_level;
    d.verdict = any ? Verdict::unexplained : Verdict::no_gap;
    return;
  }
  if (!gap) {
    d.verdict = d.gap.p_recalibration < recalibration_level ? Verdict::recalibrate : Verdict::no_gap;
    if (d.verdict == Verdict::recalibrate) d.causes.set = {d.gap.recalibration_id};
    return;
  }
  d.verdict = Verdict::unexplained;
  d.causes.p_unnamed = (1 - d.causes.p_no_gap - d.causes.p_recalibrate) * unnamed.of_unnamed();
  const bool whole = unnamed.none() < most_odds_of_none;
  if (!whole && unnamed.of_catalogue() < least_at_work) return;
  double covered = 0;
  for (const Cause& cause : d.causes.ranked) {
    if (covered >= set_share * share_of_effects ||
        cause.probability < least_of_first * d.causes.ranked.front().probability)
      break;
    d.causes.set.push_back(cause.name());
    covered += cause.probability;
  }
  list_alike(d);
  list_at_work(d, unnamed);
  const bool any =
      std::ranges::any_of(d.causes.at_work, [](const AtWork& one) { return one.probability >= least_at_work; });
  if (whole) {
    d.verdict = Verdict::explained;  // by one of the set, whichever it is
  } else if (any) {
    d.verdict = Verdict::partly_explained;
  } else {
    d.causes.set.clear();
    d.causes.alike.clear();
  }
}

}  // namespace metastable::analysis
