#include "analysis/diagnosis/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>

#include "analysis/diagnosis/at_work.h"
#include "analysis/diagnosis/not_possible.h"
#include "analysis/diagnosis/parameter_estimates.h"
#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/gap/facet_evidence.h"
#include "analysis/gap/fitted_variations.h"
#include "analysis/gap/gap_map.h"

namespace metastable::analysis {
namespace {

// This number is an overflow's, the others save time: they say beside which hypotheses something is supposed.
constexpr double largest_log_odds = 300;  // of something unnamed: their exponential stays finite
constexpr std::size_t most_beside = 3;    // hypotheses, the recalibrated model not counted,
constexpr double beside_margin = 12;      //   whose evidence is no further behind the best
constexpr double followed_weight = 1e-3;  // A hypothesis of less weight beside the best gets rough intervals.

// Returns the square that the largest of so many standard normals exceeds with this probability, to first order.
double square_by_chance(double level, std::size_t cells) {
  const boost::math::chi_squared square(1);
  return boost::math::quantile(
      boost::math::complement(square, level / static_cast<double>(std::max<std::size_t>(1, cells))));
}

double odds_of(double log_odds) { return std::exp(std::min(largest_log_odds, log_odds)); }

// Says whether a hypothesis adds an effect to a likelier one: what it leaves is then the likelier one's to leave.
bool extends_likelier(const RankedCause& cause, const std::vector<const RankedCause*>& ordered) {
  for (const RankedCause* likelier : ordered) {
    if (likelier == &cause) return false;
    if (extends(cause.terms, likelier->terms)) return true;
  }
  return false;
}

// Something unnamed beside a hypothesis.
struct Joined {
  const RankedCause* cause;
  Unnamed unnamed;
};

// Supposes something without a name beside the likeliest hypotheses.
std::vector<Joined> supposed_beside(const TransitionModel& model, const CauseRanking& ranking,
                                    const std::vector<const RankedCause*>& ordered, const Fit& recalibrated,
                                    const DiagnosisOptions& options) {
  const Rules& rules = options.rules;
  const double top = ordered.front()->evidence, tolerated = rules.facet_errors * rules.model_error * rules.model_error;
  std::vector<Joined> joined;
  for (const RankedCause* cause : ordered) {
    if (joined.size() == most_beside || cause->evidence < top - beside_margin) break;
    if (!cause->fitted() || extends_likelier(*cause, ordered)) continue;
    const PhaseGain gained = phase_gain(model, cause->fit, exact_part(ranking.singles, cause->terms, recalibrated));
    Unnamed one{{}, cause->evidence, {}};
    // Few trials, however long, do not show how cells of the map scatter.
    if (ranking.scan.trials_suffice)
      one.facets = left_by_facet(model, cause->fit, {tolerated * gained.collisions, tolerated * gained.stances}, rules);
    for (const EffectTerm& term : cause->terms) one.beside.push_back(term.candidate->id);
    if (joined.empty())
      std::ranges::move(variations_beside(model, cause->fit, tolerated * (gained.collisions + gained.stances), rules,
                                          options.threads, [] {}),
                        std::back_inserter(one.facets));
    joined.push_back({cause, std::move(one)});
  }
  return joined;
}

// Weighs something without a name, alone and beside the hypotheses. It gains no more beside one effect than both of a
// pair do, and what these leave: evidence is bounded by that.
Odds weigh_unnamed(Unnamed& alone, std::vector<Joined>& joined, const std::vector<const RankedCause*>& ordered,
                   const Rules& rules) {
  const double top = ordered.front()->evidence;
  double all = 0, of_joined = 0, beside = 0;
  for (const RankedCause* cause : ordered) all += std::exp(cause->evidence - top);
  for (Joined& one : joined) {
    bound_evidence(alone.facets, one.cause->gain, one.unnamed.facets, rules);
    for (const Joined& more : joined)
      if (&more != &one && extends(more.cause->terms, one.cause->terms))
        bound_evidence(one.unnamed.facets, more.cause->gain - one.cause->gain, more.unnamed.facets, rules);
    one.unnamed.evidence += evidence_of_more(one.unnamed.facets);
    of_joined += std::exp(one.cause->evidence - top);
    beside += odds_of(one.unnamed.evidence - top);
  }
  alone.evidence = evidence_of_more(alone.facets);
  return {rules.unnamed_alone * odds_of(alone.evidence - top) / all,
          of_joined > 0 ? rules.unnamed_beside * beside / of_joined : 0};
}

// Says whether the design itself cannot tell two effects apart where the first of them gains that much.
bool acts_alike(const std::vector<Detectability>& visible, const std::string& effect, const std::string& other,
                double gain, const Rules& rules) {
  const auto seen = std::ranges::find(visible, effect, &Detectability::effect);
  if (seen == visible.end()) return false;
  const auto share = std::ranges::find(seen->alike, other, &std::pair<std::string, double>::first);
  return share != seen->alike.end() && (1 - share->second) * gain < rules.told_apart;
}

// Lists what the design itself cannot tell from the first of the set. Of several effects one may be another one, with
// what it gains beside the others.
std::vector<std::string> alike_of(const std::vector<std::string>& set, const std::vector<Cause>& ranked,
                                  const std::vector<Detectability>& visible, const Rules& rules) {
  const Cause& first = ranked.front();
  // Returns the gain of a hypothesis of just these effects, in any order.
  const auto gain_of = [&](std::vector<std::string> effects) {
    const auto cause = std::ranges::find_if(
        ranked, [&](const Cause& one) { return std::ranges::is_permutation(one.effects, effects); });
    return cause == ranked.end() ? 0 : cause->gain;
  };
  const auto without = [](std::vector<std::string> effects, const std::string& one) {
    std::erase(effects, one);
    return effects;
  };
  const auto alike_to_first = [&](const std::string& name) {
    const auto other = std::ranges::find(ranked, name, &Cause::name);
    if (other == ranked.end() || other->effects.size() != first.effects.size()) return false;
    for (const std::string& own : first.effects) {
      const std::vector<std::string> shared = without(first.effects, own);
      for (const std::string& theirs : other->effects)
        if (std::ranges::is_permutation(shared, without(other->effects, theirs)) &&
            acts_alike(visible, own, theirs, first.gain - gain_of(shared), rules))
          return true;
    }
    return false;
  };
  std::vector<std::string> alike;
  for (const std::string& name : set)
    if (name == first.name() || alike_to_first(name)) alike.push_back(name);
  return alike.size() > 1 ? alike : std::vector<std::string>{};
}

// Lists the likeliest causes until they hold their share of what the effects have.
std::vector<std::string> set_of(const Probabilities& probabilities, const Rules& rules) {
  const double all = probabilities.of_effects();
  std::vector<std::string> set;
  double covered = 0;
  for (const Cause& cause : probabilities.ranked) {
    if (covered >= rules.set_share * all ||
        cause.probability < rules.least_of_first * probabilities.ranked.front().probability)
      break;
    set.push_back(cause.name());
    covered += cause.probability;
  }
  return set;
}

}  // namespace

Hypotheses hypotheses(const TransitionModel& model, const CauseRanking& ranking) {
  Hypotheses all;
  const auto list = [&](const RankedCause& cause, bool decided) {
    if (decided)
      all.ordered.push_back(&cause);
    else
      all.not_decided.push_back(described_cause(model, cause, ranking.scan, false));
  };
  for (const RankedCause& cause : ranking.singles) list(cause, cause.not_decided.empty());
  for (const auto* several : {&ranking.pairs, &ranking.sets})
    for (const RankedCause& cause : *several) list(cause, std::isfinite(cause.evidence));
  std::ranges::stable_sort(all.ordered, std::ranges::greater{}, &RankedCause::evidence);
  return all;
}

Chosen choose(const TransitionModel& model, const CauseRanking& ranking, const std::vector<const RankedCause*>& ordered,
              const Fit& recalibrated, Unnamed alone, const DiagnosisOptions& options) {
  const Rules& rules = options.rules;
  const RankedCause& best = *ordered.front();
  Chosen chosen{
      .fit = &best.fit, .left = gap_map(model, best.fit, options.draws, options.seed + 1), .together = best.together};
  const Fit& exact = exact_part(ranking.singles, best.terms, recalibrated);
  PhaseGain gained = phase_gain(model, best.fit, exact);
  if (model.refits_noise()) {  // how large the effect is beside the noise that it leaves, not beside what swallowed it
    Fit without;
    without.evaluation = model.evaluate(best.fit.nuisance, {});
    gained = phase_gain(model, best.fit, without);
  }
  const double all = best.fit.log_likelihood - recalibrated.log_likelihood;
  if (all > 0) chosen.bent = std::clamp((best.fit.log_likelihood - exact.log_likelihood) / all, 0.0, 1.0);
  std::vector<Joined> joined;
  // Few and short trials cannot show that events scatter as they would by themselves: facets are then not judged.
  if (ranking.scan.steps_suffice) {
    joined = supposed_beside(model, ranking, ordered, recalibrated, options);
    chosen.unnamed = weigh_unnamed(alone, joined, ordered, rules);
  }
  chosen.supposed.push_back(std::move(alone));
  for (Joined& one : joined) chosen.supposed.push_back(std::move(one.unnamed));
  const double tolerated = rules.square_error();
  const double beyond = chosen.left.largest_beyond(tolerated * gained.collisions, tolerated * gained.stances);
  const double square = square_by_chance(rules.remaining_level, chosen.left.cells.size());
  if (beyond > square) chosen.unnamed.left = odds_of(0.5 * (beyond - square));
  if (best.together > rules.surely_bent)
    chosen.unnamed.alone = std::max(chosen.unnamed.alone, rules.certain_odds);
  else if (best.together > rules.most_together)
    chosen.unnamed.left = std::max(chosen.unnamed.left, rules.even_odds);
  return chosen;
}

bool leaves_gap_held_out(const Shrinkage& log_score, const Diagnosis::Data& data, double bent, double by_itself,
                         const Rules& rules) {
  const double left = log_score.with_effect - by_itself;
  const double tolerated = rules.square_error() * rules.remaining_errors * bent * log_score.baseline;
  if (left > rules.least_remaining + tolerated) return true;
  return data.trials >= Rules::enough_trials && log_score.with_effect_least > tolerated + by_itself &&
         left * static_cast<double>(data.collisions) > rules.least_remaining_in_all;
}

double Probabilities::of_effects() const {
  double sum = 0;
  for (const Cause& cause : ranked) sum += cause.probability;
  return sum;
}

Probabilities share_probabilities(const TransitionModel& model, const CauseRanking& ranking,
                                  const std::vector<const RankedCause*>& ordered, std::size_t candidates,
                                  const Tested& tested, const Odds& unnamed, const Rules& rules) {
  const double top = ordered.empty() ? 0 : std::max(0.0, ordered.front()->evidence);
  const double effects = std::max<double>(1, static_cast<double>(candidates));
  const double weight_null = std::exp(-top);
  double given_gap = 0;
  for (const RankedCause* cause : ordered) given_gap += std::exp(cause->evidence - top) / effects;
  // The tests decide whether there is a gap, because their levels are calibrated and the evidence's are not: where both
  // disagree, the odds of a gap go no further than even.
  const double none = std::max(unnamed.none(), rules.none_prior);
  const double even = weight_null / (1 + none);
  double share = 1;
  if (given_gap > 0 && (tested.gap ? given_gap < even : given_gap > even)) share = even / given_gap;
  const double weight_none = none * (given_gap > 0 ? share * given_gap : even);
  const double sum = weight_null + share * given_gap + weight_none;
  Probabilities all;
  all.none = weight_none / sum;
  (tested.recalibrates ? all.recalibrate : all.no_gap) = weight_null / sum;
  for (const RankedCause* cause : ordered) {
    const double weight = std::exp(cause->evidence - top);
    all.ranked.push_back(described_cause(model, *cause, ranking.scan, weight > followed_weight));
    all.ranked.back().probability = share * weight / effects / sum;
  }
  return all;
}

Named give_verdict(const Probabilities& probabilities, const Odds& unnamed, const Tested& tested,
                   const std::vector<Detectability>& visible, const Diagnosis::Data& data,
                   const std::string& recalibration_id, const Rules& rules) {
  Named named;
  if (trials_to_explain(data)) {
    named.verdict = tested.gap || tested.recalibrates ? Verdict::unexplained : Verdict::no_gap;
    return named;
  }
  if (!tested.gap) {
    named.verdict = tested.recalibrates ? Verdict::recalibrate : Verdict::no_gap;
    if (tested.recalibrates) named.set = {recalibration_id};
    return named;
  }
  named.verdict = Verdict::unexplained;
  named.p_unnamed = probabilities.of_gap() * unnamed.of_unnamed();
  const bool whole = unnamed.none() < rules.most_odds_of_none();
  if (!whole && unnamed.of_catalogue() < rules.least_at_work) return named;
  std::vector<std::string> set = set_of(probabilities, rules);
  std::vector<std::string> alike = set.empty() ? set : alike_of(set, probabilities.ranked, visible, rules);
  named.at_work = list_at_work(probabilities, unnamed, alike, data.groups, rules);
  const auto any_at_work = [&] {
    return std::ranges::any_of(named.at_work,
                               [&](const AtWork& one) { return one.probability >= rules.least_at_work; });
  };
  if (whole && !any_at_work())  // one of the set explains it, whichever it is
    join_rivals(named.at_work, probabilities, unnamed, set, data.groups, rules);
  if (!any_at_work()) return named;
  named.verdict = whole ? Verdict::explained : Verdict::partly_explained;
  named.set = std::move(set);
  named.alike = std::move(alike);
  return named;
}

std::map<std::string, double> doubted_effects(const std::vector<AtWork>& at_work, const Stays& stays,
                                              const std::set<std::string>& exact) {
  std::map<std::string, double> doubted;
  for (const AtWork& one : at_work) {
    const bool lesser = one.closes_beside && one.closes_beside->upper < stays.share;
    for (const std::string& effect : one.effects)
      if (lesser || (stays.nats > 0 && exact.contains(effect))) doubted[effect] = 1 / (1 + Rules::even_odds);
  }
  return doubted;
}

Named corrected(Named named, const std::map<std::string, double>& beside, double unnamed,
                const std::vector<Cause>& ranked, const Rules& rules) {
  const auto is_there = [&](const AtWork& one) { return one.probability >= rules.least_at_work; };
  const auto before = std::ranges::count_if(named.at_work, is_there);
  for (AtWork& one : named.at_work)
    for (const std::string& effect : one.effects)
      if (const auto known = beside.find(effect); known != beside.end())
        one.probability *= 1 - unnamed * (1 - known->second);
  std::ranges::stable_sort(named.at_work, std::ranges::greater{}, &AtWork::probability);
  const auto after = std::ranges::count_if(named.at_work, is_there);
  if (after == before) return named;
  if (after > 0) {  // the set is what is left of it
    std::vector<std::string> effects;
    for (const AtWork& one : named.at_work)
      if (is_there(one)) effects.push_back(one.effects.front());
    const auto cause = std::ranges::find_if(
        ranked, [&](const Cause& one) { return std::ranges::is_permutation(one.effects, effects); });
    named.set = {cause == ranked.end() ? fmt::format("{}", fmt::join(effects, "+")) : cause->name()};
    named.alike.clear();
    return named;
  }
  named.verdict = Verdict::unexplained;
  named.set.clear();
  named.alike.clear();
  return named;
}

std::string verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_gap:
      return "no_gap";
    case Verdict::recalibrate:
      return "recalibrate";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::unexplained:
      return "unexplained";
  }
  throw std::logic_error("verdict_name: unknown verdict");
}

Verdict verdict_from_name(std::string_view name) {
  for (const Verdict verdict :
       {Verdict::no_gap, Verdict::recalibrate, Verdict::explained, Verdict::partly_explained, Verdict::unexplained})
    if (verdict_name(verdict) == name) return verdict;
  throw std::invalid_argument(
      fmt::format("verdict: \"{}\" is none of no_gap, recalibrate, explained, partly_explained, unexplained", name));
}

}  // namespace metastable::analysis
