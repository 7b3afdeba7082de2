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
#include "analysis/wheel_model/wheel_hypothesis.h"
#include "analysis/wheel_model/wheel_likelihood.h"
#include "analysis/wheel_model/wheel_nuisances.h"
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
std::vector<double> by_trial(const WheelRuns& measured, const std::vector<Event>& events,
                             const WheelHypothesis& hypothesis) {
  const Evaluation seen = wheel_likelihood(measured, events, hypothesis);
  std::vector<double> sums(measured.runs.size());
  for (std::size_t i = 0; i < events.size(); ++i) sums[events[i].trial] += seen.log_density[i];
  return sums;
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
  if (!can_be_weighed(effect.id))
    throw std::invalid_argument(fmt::format("outside effect {}: its likelihood is not known", effect.id));
  const WheelRuns measured = runs_with_legs(experiment);
  const std::vector<Event> events = wheel_events(measured);
  std::vector<double> nuisance;
  for (const Nuisance& one : wheel_nuisances(experiment.contact, std::nullopt)) nuisance.push_back(one.nominal);
  set_contact(nuisance, {contact.restitution_mean, contact.restitution_sd, contact.friction_mean, contact.friction_sd});
  const WheelHypothesis without = hypothesis_at(nuisance);
  const auto change = dynamics::outside_info(effect.id).change;
  const std::vector<Drawn> drawn = what_trials_draw(effect);
  std::vector<std::vector<double>> with;  // [what a trial drew][trial]
  for (const Drawn& one : drawn) {
    WheelHypothesis h = without;
    h.extension.torques.rolling += one.torque;
    if (change)
      h.varied = [&](const CollisionPlace& place, dynamics::StepContext& step) {
        dynamics::OutsideRatios ratios;
        change(effect.size, outside_place(place, measured, one.phase), ratios);
        step.friction_ratio *= std::max(0.0, ratios.friction);
        step.friction_scatter *= ratios.scatter;
        step.restitution_ratio *= ratios.restitution;
      };
    with.push_back(by_trial(measured, events, h));
  }
  double sum = 0;
  const std::vector<double> before = by_trial(measured, events, without);
  for (std::size_t t = 0; t < before.size(); ++t) {
    double largest = with[0][t], likelihood = 0;
    for (const std::vector<double>& one : with) largest = std::max(largest, one[t]);
    for (std::size_t d = 0; d < drawn.size(); ++d) likelihood += drawn[d].weight * std::exp(with[d][t] - largest);
    sum += largest + std::log(likelihood) - before[t];
  }
  return 2 * sum;
}

double outside_power_left(const Experiment& experiment, const dynamics::NominalValues& contact,
                          const dynamics::OutsideEffect& effect) {
  const auto model = wheel_transitions(experiment);
  const std::vector<double> nuisance = true_nuisances(*model, contact);
  const double gained = fit(*model, nuisance, {}).log_likelihood - model->evaluate(nuisance, {}).total();
  return outside_power(experiment, contact, effect) - 2 * gained;
}

}  // namespace metastable::analysis
