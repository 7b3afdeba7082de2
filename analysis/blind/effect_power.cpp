#include "analysis/blind/effect_power.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>

#include "analysis/blind/outside_power.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/wheel_model/wheel_nuisances.h"
#include "analysis/wheel_model/wheel_transitions.h"

namespace metastable::analysis {
namespace {

// The likelihoods of a gap are averaged over so many drawn experiments. Parameters are fitted to the first few of them.
constexpr std::uint64_t draws_of_gap = 16;
constexpr std::size_t fits_of_gap = 4;

// Nuisances with effects, as a model supposes them.
struct Supposed {
  std::vector<double> nuisance;
  std::vector<EffectTerm> terms;
};

// Returns what fits best in the mean over experiments. On those that it is fitted to, a fit gains by chance as much as
// it loses on as many others.
Supposed best_supposed(const std::vector<std::unique_ptr<TransitionModel>>& drawn, const Supposed& start,
                       bool recalibrated) {
  Supposed mean = start;
  const auto add = [](std::vector<double>& sum, const std::vector<double>& values) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += values[i] / fits_of_gap;
  };
  std::ranges::fill(mean.nuisance, 0);
  for (EffectTerm& term : mean.terms) std::ranges::fill(term.values, 0);
  for (std::size_t k = 0; k < fits_of_gap; ++k) {
    const Fit one = fit(*drawn[k], start.nuisance, start.terms, {.count = {}, .refit_nuisances = recalibrated});
    add(mean.nuisance, one.nuisance);
    for (std::size_t t = 0; t < mean.terms.size(); ++t) add(mean.terms[t].values, one.terms[t].values);
  }
  return mean;
}

}  // namespace

EffectTerm fitted_term(const TransitionModel& model, const dynamics::Effect& effect) {
  for (const Candidate& candidate : model.candidates())
    if (candidate.id == effect.id) return term_of(candidate, effect.values);
  throw std::invalid_argument(fmt::format("effect {}: the model has no candidate for it", effect.id));
}

dynamics::NominalValues contact_with(const dynamics::NominalValues& stated,
                                     const std::vector<dynamics::Effect>& effects) {
  dynamics::NominalValues truth = stated;
  for (const dynamics::Effect& effect : effects)
    if (effect.id == dynamics::contact_distribution_id) {
      truth.restitution_mean = effect.values[0];
      truth.restitution_sd = effect.values[1];
      truth.friction_mean = effect.values[2];
      truth.friction_sd = effect.values[3];
    }
  return truth;
}

std::vector<EffectTerm> fitted_terms(const TransitionModel& model, const std::vector<dynamics::Effect>& effects) {
  std::vector<EffectTerm> terms;
  for (const dynamics::Effect& effect : effects)
    if (effect.id != dynamics::contact_distribution_id) terms.push_back(fitted_term(model, effect));
  return terms;
}

std::vector<double> true_nuisances(const TransitionModel& model, const dynamics::NominalValues& contact) {
  std::vector<double> values = nominal_values(model);
  set_contact(values, {contact.restitution_mean, contact.restitution_sd, contact.friction_mean, contact.friction_sd});
  return values;
}

double expected_power(const PowerDesign& design, const std::vector<dynamics::Effect>& effects, int replicates) {
  if (replicates < 1) throw std::invalid_argument(fmt::format("replicates: {} is below 1", replicates));
  double sum = 0;
  for (int r = 0; r < replicates; ++r) {
    LaboratoryOptions laboratory = design.laboratory;
    laboratory.effects = effects;
    laboratory.seed = design.laboratory.seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(r + 1);
    const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, laboratory);
    const LaboratoryFiles made =
        laboratory_files(design.conditions, setup, run_laboratory(setup, 1), {.dropped = design.dropped});
    const Experiment experiment = parse_experiment(source_of(made.files, "laboratory"));
    const Setting& stated = design.conditions.front().setting;
    const dynamics::NominalValues contact = stated_values(stated.restitution, stated.friction, stated.wheel.leg_length);
    if (!laboratory.outside.empty()) {
      sum += outside_power(experiment, contact, laboratory.outside.front());
      continue;
    }
    const auto model = wheel_transitions(experiment);
    const std::vector<double> with = true_nuisances(*model, contact_with(contact, effects));
    sum += 2 * (model->evaluate(with, fitted_terms(*model, effects)).total() -
                model->evaluate(true_nuisances(*model, contact), {}).total());
  }
  return sum / replicates;
}

double power_left(const Experiment& experiment, const dynamics::NominalValues& truth,
                  const std::vector<dynamics::Effect>& effects, const std::vector<dynamics::Effect>& kept,
                  bool fitted) {
  const auto model = wheel_transitions(experiment);
  const std::vector<double> nuisance = true_nuisances(*model, contact_with(truth, effects));
  const std::vector<EffectTerm> terms = fitted_terms(*model, effects);
  const double with = fitted ? fit(*model, nuisance, terms).log_likelihood : model->evaluate(nuisance, terms).total();
  return 2 * (with - fit(*model, nuisance, fitted_terms(*model, kept)).log_likelihood);
}

GapAsGiven gap_as_given(const TransitionModel& model, const std::vector<double>& nuisance,
                        const std::vector<EffectTerm>& terms) {
  const std::vector<double> given = given_values(model);
  const std::vector<double> whole =
      fit(model, nuisance, terms, {.count = {}, .refit_nuisances = true, .refit_effects = false}).nuisance;
  std::vector<std::unique_ptr<TransitionModel>> drawn;
  for (std::uint64_t draw = 1; draw <= draws_of_gap; ++draw) drawn.push_back(model.simulate(whole, terms, draw));
  const auto mean = [&](const Supposed& one) {
    double sum = 0;
    for (const auto& experiment : drawn) sum += 2 * experiment->evaluate(one.nuisance, one.terms).total();
    return sum / static_cast<double>(drawn.size());
  };
  const double truth = mean({whole, terms}), without = mean({given, {}});
  GapAsGiven gap{truth - without, {}, {}};
  for (std::size_t e = 0; e < terms.size(); ++e) {
    std::vector<EffectTerm> others = terms;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(e));
    gap.alone.push_back(mean(best_supposed(drawn, {given, {terms[e]}}, false)) - without);
    gap.beside.push_back(truth - mean(best_supposed(drawn, {whole, others}, true)));
  }
  return gap;
}

GapAsGiven gap_as_given(const Experiment& experiment, const dynamics::NominalValues& truth,
                        const std::vector<dynamics::Effect>& effects) {
  const auto model = wheel_transitions(experiment);
  return gap_as_given(*model, true_nuisances(*model, contact_with(truth, effects)), fitted_terms(*model, effects));
}

}  // namespace metastable::analysis
