#include "analysis/diagnosis/beside_unnamed.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// A variation in an effect's place is fitted where a scan promises it these odds or more, which saves time. Odds above
// the second number are told as that number, so that they do not overflow.
constexpr double least_odds = 0.05, largest_odds_in_place = 1e12;

// Returns the place of the variation that says most by itself, by the facets it was weighed in; nothing where it was
// none.
std::optional<std::size_t> strongest_alone(const TransitionModel& model, const std::vector<LeftInFacet>& alone,
                                           const LeftInFacet** said = nullptr) {
  const LeftInFacet* most = nullptr;
  std::optional<std::size_t> place;
  for (std::size_t i = 0; i < model.variations().size(); ++i)
    for (const LeftInFacet& left : alone)
      if (left.facet == model.variations()[i].facet && left.aspect == model.variations()[i].aspect &&
          (!most || left.evidence > most->evidence)) {
        most = &left;
        place = i;
      }
  if (said) *said = most;
  return place;
}

// Returns the places of the variations that say most: beside the hypothesis, by its scores, and at the recalibrated
// model.
std::vector<std::size_t> leading_variations(const TransitionModel& model, const EffectScan& scan,
                                            const std::vector<LeftInFacet>& alone, const Rules& rules) {
  const auto best = std::ranges::max_element(
      scan.effects, {}, [&](const ScannedEffect& one) { return evidence_of(one, one.gain[one.best], rules); });
  std::vector<std::size_t> leading{static_cast<std::size_t>(best - scan.effects.begin())};
  if (const auto strongest = strongest_alone(model, alone); strongest && *strongest != leading.front())
    leading.push_back(*strongest);
  return leading;
}

double square(double x) { return x * x; }

std::vector<const Candidate*> variations_of(const TransitionModel& model) {
  std::vector<const Candidate*> varying;
  for (const Variation& variation : model.variations()) varying.push_back(&variation.candidate);
  return varying;
}

// Weighs the gain of one more effect beside others, of which one of several variants was chosen.
double evidence_of_term(const Candidate& effect, double gain, const Rules& rules) {
  return evidence_of_gain(std::max(0.0, gain), static_cast<double>(effect.parameters.size()), rules) -
         std::log(static_cast<double>(effect.variants.size()));
}

// Fits the hypothesis that a variation ends again without each of its effects.
std::vector<Fit> without_each(const TransitionModel& model, const Fit& joined, const Effort& effort, int threads,
                              const std::function<void()>& beat) {
  std::vector<Fit> without(joined.terms.size() - 1);
  model.side_by_side(without.size(), threads, [&](std::size_t k) {
    beat();
    std::vector<EffectTerm> others = joined.terms;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    without[k] = fit(model, joined.nuisance, others,
                     {.count = {}, .refit_nuisances = true, .most_iterations = effort.most_iterations});
  });
  return without;
}

// Returns by how much [ln] the odds of a variation, the last term of `joined`, rise when effects that say nothing
// beside it leave the hypothesis, too. An effect that stays costs Rules::pair_prior and brings its evidence.
double log_odds_of_fewer(const TransitionModel& model, Fit joined, const Effort& effort,
                         const DiagnosisOptions& options, const std::function<void()>& beat) {
  double saved = 0;
  while (joined.terms.size() > 1) {
    std::vector<Fit> without = without_each(model, joined, effort, options.threads, beat);
    std::vector<double> log_odds;
    for (std::size_t k = 0; k < without.size(); ++k)
      log_odds.push_back(
          std::log(options.rules.pair_prior) +
          evidence_of_term(*joined.terms[k].candidate, 2 * (joined.penalised - without[k].penalised), options.rules));
    const auto least = std::ranges::min_element(log_odds);
    if (*least >= 0) break;
    saved -= *least;
    joined = std::move(without[static_cast<std::size_t>(least - log_odds.begin())]);
  }
  return saved;
}

}  // namespace

std::optional<InPlace> varies_without_name(const TransitionModel& model, const std::vector<LeftInFacet>& alone) {
  const std::optional<std::size_t> place = strongest_alone(model, alone);
  if (!place) return {};
  const Variation& one = model.variations()[*place];
  const auto most = std::ranges::max_element(alone, {}, &LeftInFacet::evidence);
  if (most->facet != one.facet || most->aspect != one.aspect) return {};
  return InPlace{*place, most->quadratic, 0};
}

const Variation* same_variation(const TransitionModel& model, const RankedCause& best,
                                const std::vector<LeftInFacet>& alone, const Rules& rules) {
  if (best.terms.size() != 1) return nullptr;
  const LeftInFacet* said = nullptr;
  const std::optional<std::size_t> place = strongest_alone(model, alone, &said);
  if (!place) return nullptr;
  const Variation& one = model.variations()[*place];
  const bool named = std::ranges::find(one.named, best.terms.front().candidate->id) != one.named.end();
  const double most = std::ranges::max_element(alone, {}, &LeftInFacet::evidence)->evidence;
  const bool as_much =
      std::abs(said->quadratic - best.gain) < rules.told_apart && most < said->evidence + 0.5 * rules.told_apart;
  return named && as_much ? &one : nullptr;
}

std::optional<InPlace> in_place_of_effects(const TransitionModel& model, const CauseRanking& ranking,
                                           const RankedCause& best, const Fit& recalibrated, FitsWithout& without,
                                           std::size_t facets, const DiagnosisOptions& options,
                                           const std::function<void()>& heartbeat) {
  const std::vector<const Candidate*> varying = variations_of(model);
  if (varying.empty() || best.fit.terms.size() < 2 || !ranking.scan.steps_suffice) return {};
  const double prior = std::log(options.rules.unnamed_alone / static_cast<double>(std::max<std::size_t>(1, facets)));
  std::optional<InPlace> found;
  double most = std::log(least_odds);
  const Fit* others = nullptr;
  ScannedEffect leader;
  double own_of_leader = 0;
  for (std::size_t k = 0; k < best.fit.terms.size(); ++k) {
    const Fit& rest = without.term(k, heartbeat);
    const double own =
        evidence_of_term(*best.fit.terms[k].candidate, 2 * (best.fit.penalised - rest.penalised), options.rules);
    const EffectScan scan = scan_effects(model, rest, varying, options.threads);
    if (scan.effects.size() != varying.size()) continue;
    for (std::size_t v = 0; v < varying.size(); ++v) {
      const ScannedEffect& one = scan.effects[v];
      const double promised = prior + evidence_of(one, one.gain[one.best], options.rules) - own;
      if (!(promised > most)) continue;
      most = promised;
      found = InPlace{v, 0, 0};
      others = &rest;
      leader = one;
      own_of_leader = own;
    }
  }
  if (!found) return {};
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  beat();
  const Effort effort = effort_for(model, recalibrated);
  const Fit with = fit_one_more(model, effort, *others, leader, true);
  const double least = -std::log(options.rules.most_odds_of_none());  // The name stays while it may be as likely.
  found->gain = std::max(0.0, 2 * (with.penalised - others->penalised));
  double log_odds = prior + evidence_of(leader, found->gain, options.rules) - own_of_leader;
  if (log_odds > std::log(least_odds) && log_odds <= least)  // Higher odds decide without that.
    log_odds += log_odds_of_fewer(model, with, effort, options, beat);
  if (!(log_odds > least)) return {};
  found->odds = std::exp(std::min(std::log(largest_odds_in_place), log_odds));
  return found;
}

std::map<std::string, double> probabilities_beside_unnamed(const TransitionModel& model, const CauseRanking& ranking,
                                                           const RankedCause& best, const Fit& recalibrated,
                                                           const std::vector<LeftInFacet>& alone,
                                                           const std::optional<InPlace>& there, std::size_t candidates,
                                                           const DiagnosisOptions& options,
                                                           const std::function<void()>& heartbeat) {
  const std::vector<const Candidate*> varying = variations_of(model);
  if (varying.empty() || !ranking.scan.steps_suffice) return {};
  const EffectScan scan = scan_effects(model, best.fit, varying, options.threads);
  if (scan.effects.size() != varying.size()) return {};
  const Effort effort = effort_for(model, recalibrated);
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  const std::vector<std::size_t> leading =
      there ? std::vector{there->variation} : leading_variations(model, scan, alone, options.rules);
  std::vector<Fit> with(leading.size());
  model.side_by_side(with.size(), options.threads, [&](std::size_t k) {
    beat();
    with[k] = fit_one_more(model, effort, best.fit, scan.effects[leading[k]], true);
  });
  Fit joined = std::move(*std::ranges::max_element(with, {}, &Fit::penalised));
  if (!(joined.penalised >= best.fit.penalised)) return {};
  const double forgiven = there ? square(options.rules.variation_error) * there->gain : 0;
  std::map<std::string, double> by_effect;
  while (joined.terms.size() > 1) {
    std::vector<Fit> without = without_each(model, joined, effort, options.threads, beat);
    std::vector<double> probability;
    for (std::size_t k = 0; k < without.size(); ++k) {
      const Candidate& effect = *joined.terms[k].candidate;
      const double gain = 2 * (joined.penalised - without[k].penalised) - forgiven;
      const double log_odds = evidence_of_term(effect, gain, options.rules) -
                              std::log(static_cast<double>(std::max<std::size_t>(1, candidates)));
      by_effect[effect.id] = probability.emplace_back(1 / (1 + std::exp(-log_odds)));
    }
    const auto least = std::ranges::min_element(probability);
    if (!there || *least >= options.rules.least_at_work) break;
    joined = std::move(without[static_cast<std::size_t>(least - probability.begin())]);
  }
  return by_effect;
}

}  // namespace metastable::analysis
