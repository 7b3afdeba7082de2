#include "analysis/blind/outside_power.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "analysis/blind/effect_power.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/wheel_model/contact_variation.h"
#include "analysis/wheel_model/wheel_runs.h"
#include "analysis/wheel_model/wheel_transitions.h"

namespace metastable::analysis {
namespace {

constexpr std::string_view wind = "crosswind", sway = "swaying_floor";
constexpr int wind_nodes = 17, phases = 24;
constexpr double strongest_wind = 3.2;  // [sds]

// Something that a trial may have drawn, and how likely that is.
struct Drawn {
  double weight = 1, torque = 0, phase = 0;
};
std::vector<Drawn> what_trials_draw(const dynamics::OutsideEffect& effect) {
  std::vector<Drawn> all;
  if (effect.id == wind) {
    double sum = 0;
    for (int i = 0; i < wind_nodes; ++i) {
      const double z = strongest_wind * (2.0 * i / (wind_nodes - 1) - 1);
      all.push_back({std::exp(-z * z / 2), effect.size * z, 0});
      sum += all.back().weight;
    }
    for (Drawn& one : all) one.weight /= sum;
  } else if (effect.id == sway) {
    for (int i = 0; i < phases; ++i) all.push_back({1.0 / phases, 0, 2 * std::numbers::pi * i / phases});
  } else {
    all.push_back({});
  }
  return all;
}

dynamics::OutsidePlace outside_place(const CollisionPlace& place, const WheelRuns& measured, double phase) {
  return {place.step.leg,  place.step.position,        place.omega, -place.gained,
          place.clock,     place.number == 1,          place.trial, measured.runs.size(),
          place.condition, measured.conditions.size(), phase};
}

// Returns the log likelihood trial by trial.
std::vector<double> by_trial(const TransitionModel& model, const Evaluation& seen, std::size_t trials) {
  std::vector<double> sums(trials);
  for (std::size_t i = 0; i < seen.log_density.size(); ++i) sums[model.events()[i].trial] += seen.log_density[i];
  return sums;
}

// Says by how much the effect changes the contact of each collision, in one aspect.
// @throws std::logic_error for an effect that changes two
Addition contacts_changed(const WheelRuns& measured, const dynamics::OutsideEffect& effect, double phase) {
  constexpr double least_ratio = 0.05;  // vary() takes none below it
  const auto change = dynamics::outside_info(effect.id).change;
  Addition changed;
  std::optional<std::size_t> number;
  for (std::size_t t = 0; t < measured.runs.size(); ++t) {
    const WheelRun& run = measured.runs[t];
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      dynamics::OutsideRatios ratios;
      double by = 1;
      const CollisionPlace place = collision_place(run, t, k, run.collisions[k], run.collisions[k].before);
      if (change) change(effect.size, outside_place(place, measured, phase), ratios);
      for (const auto& [aspect, ratio] : {std::pair{ContactAspect::mean_friction, ratios.friction},
                                          {ContactAspect::mean_restitution, ratios.restitution},
                                          {ContactAspect::scatter_of_friction, ratios.scatter}}) {
        if (ratio == 1) continue;
        if (number && *number != static_cast<std::size_t>(aspect))
          throw std::logic_error(fmt::format("outside effect {} changes two aspects of contacts", effect.id));
        number = static_cast<std::size_t>(aspect);
        by = ratio;
      }
      changed.weights.push_back(std::log(std::max(least_ratio, by)));
    }
  }
  changed.number = number.value_or(static_cast<std::size_t>(ContactAspect::mean_friction));
  return changed;
}

// Adds a constant torque [N m] to what the terms hold.
std::vector<EffectTerm> with_torque(const TransitionModel& model, std::vector<EffectTerm> terms, double torque) {
  if (torque == 0) return terms;
  const EffectTerm added = fitted_term(model, {"rolling_resistance", {torque}});
  for (EffectTerm& term : terms)
    if (term.candidate == added.candidate) {
      term.values[0] += added.values[0];
      return terms;
    }
  terms.push_back(added);
  return terms;
}

// Returns the log likelihood with the effect beside the terms. What trials draw is integrated over.
double with_outside(const TransitionModel& model, const WheelRuns& measured, const std::vector<double>& nuisance,
                    const std::vector<EffectTerm>& terms, const dynamics::OutsideEffect& effect) {
  const std::vector<Drawn> drawn = what_trials_draw(effect);
  std::vector<std::vector<double>> with;  // [what a trial drew][trial]
  for (const Drawn& one : drawn)
    with.push_back(by_trial(model,
                            model.evaluate_with(nuisance, with_torque(model, terms, one.torque),
                                                contacts_changed(measured, effect, one.phase)),
                            measured.runs.size()));
  double sum = 0;
  for (std::size_t t = 0; t < measured.runs.size(); ++t) {
    double largest = with[0][t], likelihood = 0;
    for (const std::vector<double>& one : with) largest = std::max(largest, one[t]);
    for (std::size_t d = 0; d < drawn.size(); ++d) likelihood += drawn[d].weight * std::exp(with[d][t] - largest);
    sum += largest + std::log(likelihood);
  }
  return sum;
}

void require_weighed(const dynamics::OutsideEffect& effect) {
  if (!can_be_weighed(effect.id))
    throw std::invalid_argument(fmt::format("outside effect {}: its likelihood is not known", effect.id));
}

}  // namespace

bool can_be_weighed(std::string_view outside) {
  return outside == wind || dynamics::outside_info(outside).change != nullptr;
}

std::set<std::string> columns_needed(std::string_view outside) {
  for (const std::string_view by_leg : {"double_plate", "loose_feet", "wearing_leg"})
    if (outside == by_leg) return {"leg"};
  for (const std::string_view by_place : {"planks", "rough_stretch"})  // slides make places that follow from legs drift
    if (outside == by_place) return {"position_m"};
  return {};
}

double outside_power(const Experiment& experiment, const dynamics::NominalValues& contact,
                     const dynamics::OutsideEffect& effect) {
  require_weighed(effect);
  const auto model = wheel_transitions(experiment);
  const std::vector<double> nuisance = true_nuisances(*model, contact);
  return 2 * (with_outside(*model, runs_with_legs(experiment), nuisance, {}, effect) -
              model->evaluate(nuisance, {}).total());
}

double outside_power_left(const Experiment& experiment, const dynamics::NominalValues& contact,
                          const dynamics::OutsideEffect& effect, const std::vector<dynamics::Effect>& beside) {
  require_weighed(effect);
  const auto model = wheel_transitions(experiment);
  const WheelRuns measured = runs_with_legs(experiment);
  const std::vector<double> nuisance = true_nuisances(*model, contact_with(contact, beside));
  const std::vector<EffectTerm> terms = fitted_terms(*model, beside);
  const Fit without = fit(*model, nuisance, terms);
  const double truth = std::max(with_outside(*model, measured, nuisance, terms, effect),
                                with_outside(*model, measured, without.nuisance, without.terms, effect));
  return 2 * (truth - without.log_likelihood);
}

}  // namespace metastable::analysis
