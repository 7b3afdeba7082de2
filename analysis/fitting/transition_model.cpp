#include "analysis/fitting/transition_model.h"

#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "markov/parallel.h"

namespace metastable::analysis {

double Nuisance::cost(double value) const {
  const double off = (value - nominal) / prior_sd, square = off * off / 2;
  return misstated > 0 ? -std::log((1 - misstated) * std::exp(-square) + misstated) : square;
}

double Nuisance::pull(double value) const { return (value - nominal) * information(value); }

double Nuisance::information(double value) const {
  const double off = (value - nominal) / prior_sd, stated = (1 - misstated) * std::exp(-off * off / 2);
  const double belief = misstated > 0 ? stated / (stated + misstated) : 1;  // that it was stated rightly
  return belief / (prior_sd * prior_sd);
}

bool begins_step(const std::vector<Event>& events, std::size_t event) {
  const auto is_step = [](const Event& e) { return e.kind == EventKind::collision || e.kind == EventKind::step; };
  const Event& here = events[event];
  if (!is_step(here) || event == 0) return is_step(here);
  const Event& before = events[event - 1];
  return !is_step(before) || before.trial != here.trial || before.number != here.number;
}

std::string TransitionModel::leg_word(int leg) const { return "leg " + std::to_string(leg); }

double Evaluation::total() const { return std::accumulate(log_density.begin(), log_density.end(), 0.0); }

EffectTerm term_of(const Candidate& candidate, const std::vector<double>& catalogue_values) {
  FittedForm form = candidate.form_of ? candidate.form_of(catalogue_values)
                                      : FittedForm{candidate.variants.front(), catalogue_values};
  return {&candidate, std::move(form.variant), std::move(form.values)};
}

void TransitionModel::side_by_side(std::size_t count, int threads, const std::function<void(std::size_t)>& work) const {
  markov::parallel_for(count, threads, work);
}

std::optional<Addition> TransitionModel::addition(const EffectTerm&, std::size_t) const { return std::nullopt; }

Evaluation TransitionModel::evaluate_with(std::span<const double>, std::span<const EffectTerm>, const Addition&) const {
  throw std::logic_error("TransitionModel::evaluate_with: this model has no additions");
}

std::vector<FitStart> TransitionModel::starts(std::span<const EffectTerm>) const { return {}; }

std::vector<std::string> TransitionModel::effect_ids() const {
  std::vector<std::string> ids;
  for (const Candidate& candidate : candidates()) ids.push_back(candidate.id);
  return ids;
}

const std::vector<Variation>& TransitionModel::variations() const {
  static const std::vector<Variation> none;
  return none;
}

std::vector<ChangedExperiment> TransitionModel::alternatives(std::span<const double>, std::span<const EffectTerm>,
                                                             std::uint64_t) const {
  return {};
}

std::pair<std::string, std::unique_ptr<TransitionModel>> TransitionModel::elsewhere(
    const std::vector<NamedValue>& place) const {
  throw std::invalid_argument(
      place.empty() ? std::string("elsewhere: no place is named")
                    : place.front().first + ": the expected steps of this system are known only where it was measured");
}

std::unique_ptr<TransitionModel> TransitionModel::relaunched(std::uint64_t) const { return nullptr; }

std::string TransitionModel::size_in_words(std::span<const EffectTerm>) const { return {}; }

void TransitionModel::require_own_draws(const Fit&) const {}

std::vector<std::string> TransitionModel::misstated(const Fit&) const { return {}; }

std::vector<double> TransitionModel::rest_chances(std::span<const double>, std::span<const EffectTerm>) const {
  return std::vector<double>(events().size(), 0);
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> TransitionModel::completed(
    std::span<const double>, std::uint64_t) const {
  return {};
}

}  // namespace metastable::analysis
