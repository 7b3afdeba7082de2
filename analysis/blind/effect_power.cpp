#include "analysis/blind/effect_power.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "analysis/diagnosis/model_fit.h"
#include "analysis/likelihood/wheel_transitions.h"

namespace metastable::analysis {
namespace {

dynamics::NominalValues contact_of(const dynamics::NominalValues& stated,
                                   const std::vector<dynamics::Effect>& effects) {
  dynamics::NominalValues truth = stated;
  for (const dynamics::Effect& effect : effects)
    if (effect.id == "contact_distribution") {
      truth.restitution_mean = effect.values[0];
      truth.restitution_sd = effect.values[1];
      truth.friction_mean = effect.values[2];
      truth.friction_sd = effect.values[3];
    }
  return truth;
}

double log_likelihood(const TransitionModel& model, const std::vector<double>& nuisance,
                      const std::vector<FittedForm>& forms) {
  std::vector<Term> terms;
  for (const FittedForm& form : forms) terms.push_back({&form.candidate, form.candidate.variants[0], form.values});
  return model.evaluate(nuisance, terms).total();
}

std::vector<FittedForm> forms_of(const std::vector<dynamics::Effect>& effects, const Experiment& experiment) {
  std::vector<FittedForm> forms;
  for (const dynamics::Effect& effect : effects)
    if (effect.id != "contact_distribution")
      forms.push_back(fitted_form(effect, experiment.wheel.leg_length, experiment.conditions.front().ramp_length));
  return forms;
}

}  // namespace

FittedForm fitted_form(const dynamics::Effect& effect, const std::vector<double>& stated_legs, double ramp_length) {
  dynamics::effect_info(effect.id);
  FittedForm form;
  form.candidate.id = effect.id;
  std::vector<double>& variant = form.candidate.variants.front();
  const std::vector<double>& v = effect.values;
  if (effect.id == "contact_distribution")
    throw std::invalid_argument("contact_distribution: its parameters are the model's nuisances");
  if (effect.id == "leg_lengths") {
    for (std::size_t i = 0; i < v.size(); ++i) form.values.push_back(v[i] - stated_legs.at(i));
  } else if (effect.id == "leg_contact") {
    const bool friction = v[1] != 1 || v[2] == 1;  // both at once have no fitted form: friction's is taken
    variant = {v[0], friction ? 0.0 : 1.0};
    form.values = {friction ? v[1] : v[2]};
  } else if (effect.id == "hub_eccentricity") {
    form.values = {v[0] * std::cos(v[1]), v[0] * std::sin(v[1])};
  } else if (effect.id == "slope_profile") {
    variant = {0, v[1], v[2] > 0 ? v[2] : ramp_length};
    form.values = {v[0]};
  } else if (effect.id == "speed_dependent_friction") {
    variant = {v[1]};
    form.values = {v[0]};
  } else if (effect.id == "friction_patch") {
    variant = {v[0], v[1] > 0 ? v[1] : ramp_length};
    form.values = {v[2]};
  } else if (effect.id == "trial_spread" || effect.id == "sensor_noise") {
    form.values = {v[0] * v[0]};
  } else if (effect.id == "contact_outliers") {
    variant = {v[1]};
    form.values = {v[0]};
  } else if (effect.id == "sensor_bias") {
    variant = {1, 1};
    form.values = {v[0]};
  } else if (effect.id == "ramp_vibration") {
    variant = {v[1]};
    form.values = {v[0], 0};
  } else {
    form.values = v;
  }
  return form;
}

std::vector<double> true_nuisances(const TransitionModel& model, const dynamics::NominalValues& contact) {
  std::vector<double> values;
  for (const Nuisance& nuisance : model.nuisances()) {
    double value = nuisance.nominal;
    if (nuisance.name == "restitution_mean") value = contact.restitution_mean;
    if (nuisance.name == "log restitution_sd") value = std::log(contact.restitution_sd);
    if (nuisance.name == "friction_mean") value = contact.friction_mean;
    if (nuisance.name == "log friction_sd") value = std::log(contact.friction_sd);
    values.push_back(value);
  }
  return values;
}

double expected_power(const PowerDesign& design, const std::vector<dynamics::Effect>& effects, int replicates) {
  if (replicates < 1) throw std::invalid_argument(fmt::format("replicates: {} is below 1", replicates));
  double sum = 0;
  for (int r = 0; r < replicates; ++r) {
    RealityOptions reality = design.reality;
    reality.effects = effects;
    reality.seed = design.reality.seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(r + 1);
    const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, reality);
    const RealityFiles made =
        reality_files(design.conditions, setup, run_laboratory(setup, 1), {.dropped = design.dropped});
    const Experiment experiment = parse_experiment(source_of(made.files, "laboratory"));
    const auto model = wheel_transitions(experiment);
    const Setting& stated = design.conditions.front().setting;
    const dynamics::NominalValues contact = stated_values(stated.restitution, stated.friction, stated.wheel.leg_length);
    sum += 2 * (log_likelihood(*model, true_nuisances(*model, contact_of(contact, effects)),
                               forms_of(effects, experiment)) -
                log_likelihood(*model, true_nuisances(*model, contact), {}));
  }
  return sum / replicates;
}

double power_left(const Experiment& experiment, const dynamics::NominalValues& truth,
                  const std::vector<dynamics::Effect>& effects, const std::vector<dynamics::Effect>& kept) {
  const auto model = wheel_transitions(experiment);
  const std::vector<double> nuisance = true_nuisances(*model, contact_of(truth, effects));
  const double with = log_likelihood(*model, nuisance, forms_of(effects, experiment));
  std::vector<Term> terms;
  for (const dynamics::Effect& effect : kept)
    for (const Candidate& candidate : model->candidates())
      if (candidate.id == effect.id) {
        const FittedForm form =
            fitted_form(effect, experiment.wheel.leg_length, experiment.conditions.front().ramp_length);
        terms.push_back({&candidate, form.candidate.variants.front(), form.values});
      }
  return 2 * (with - fit(*model, nuisance, terms).log_likelihood);
}

}  // namespace metastable::analysis
