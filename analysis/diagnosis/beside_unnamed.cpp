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

// Returns the places of the variations that say most: beside the hypothesis, by its scores, and at the recalibrated
// model.
std::vector<std::size_t> leading_variations(const TransitionModel& model, const EffectScan& scan,
                                            const std::vector<LeftInFacet>& alone, const Rules& rules) {
  std::vector<std::size_t> leading;
  const auto best = std::ranges::max_element(
      scan.effects, {}, [&](const ScannedEffect& one) { return evidence_of(one, one.gain[one.best], rules); });
  leading.push_back(static_cast<std::size_t>(best - scan.effects.begin()));
  const LeftInFacet* most = nullptr;
  std::size_t place = 0;
  for (std::size_t i = 0; i < model.variations().size(); ++i)
    for (const LeftInFacet& left : alone)
      if (left.facet == model.variations()[i].facet && left.aspect == model.variations()[i].aspect &&
          (!most || left.evidence > most->evidence)) {
        most = &left;
        place = i;
      }
  if (most && place != leading.front()) leading.push_back(place);
  return leading;
}

}  // namespace

std::map<std::string, double> probabilities_beside_unnamed(const TransitionModel& model, const CauseRanking& ranking,
                                                           const RankedCause& best, const Fit& recalibrated,
                                                           const std::vector<LeftInFacet>& alone,
                                                           std::size_t candidates, const DiagnosisOptions& options,
                                                           const std::function<void()>& heartbeat) {
  std::vector<const Candidate*> varying;
  for (const Variation& variation : model.variations()) varying.push_back(&variation.candidate);
  if (varying.empty() || !ranking.scan.trials_suffice) return {};
  const EffectScan scan = scan_effects(model, best.fit, varying, options.threads);
  if (scan.effects.size() != varying.size()) return {};
  const Effort effort = effort_for(model, recalibrated);
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  const std::vector<std::size_t> leading = leading_variations(model, scan, alone, options.rules);
  std::vector<Fit> with(leading.size());
  model.side_by_side(with.size(), options.threads, [&](std::size_t k) {
    beat();
    with[k] = fit_one_more(model, effort, best.fit, scan.effects[leading[k]], true);
  });
  const Fit& joined = *std::ranges::max_element(with, {}, &Fit::penalised);
  if (!(joined.penalised >= best.fit.penalised)) return {};
  std::vector<double> probability(best.terms.size());
  model.side_by_side(best.terms.size(), options.threads, [&](std::size_t k) {
    beat();
    std::vector<EffectTerm> others = joined.terms;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const Fit without = fit(model, joined.nuisance, others,
                            {.count = {}, .refit_nuisances = true, .most_iterations = effort.most_iterations});
    const Candidate& effect = *best.terms[k].candidate;
    const double gain = std::max(0.0, 2 * (joined.penalised - without.penalised));
    // One effect of so many, and one of its variants, beside what has no name.
    const double log_odds = evidence_of_gain(gain, static_cast<double>(effect.parameters.size()), options.rules) -
                            std::log(static_cast<double>(effect.variants.size())) -
                            std::log(static_cast<double>(std::max<std::size_t>(1, candidates)));
    probability[k] = 1 / (1 + std::exp(-log_odds));
  });
  std::map<std::string, double> by_effect;
  for (std::size_t k = 0; k < best.terms.size(); ++k) by_effect[best.terms[k].candidate->id] = probability[k];
  return by_effect;
}

}  // namespace metastable::analysis
