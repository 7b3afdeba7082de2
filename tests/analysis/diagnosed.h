#pragma once
// Makes experiments for the tests of the diagnosis.

#include <span>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/wheel_transitions.h"

namespace metastable::analysis::test {

/// Returns the design of an experiment on the 9.59 and 7.02 deg ramps, its speeds still to be drawn.
inline Experiment wheel_design(std::size_t trials, std::size_t collisions, bool speeds_after = true) {
  Experiment e;
  e.contact = {dynamics::Law::published, {0.54, 0.045}, {0.352, 0.043}};
  e.conditions = {{"fast-9.59", 9.59, 3.66, Spread{5.83, 0.28}, 0}, {"fast-7.02", 7.02, 3.66, Spread{7.35, 0.19}, 0}};
  e.sensor.noise_sd = 0.008;
  e.columns = {Presence::all, Presence::all, Presence::all, speeds_after ? Presence::all : Presence::none, true};
  for (std::size_t t = 0; t < trials; ++t) {
    MeasuredTrial trial;
    trial.number = static_cast<int>(t) + 1;
    trial.condition = t % 2;
    trial.outcome = dynamics::Outcome::max_collisions;
    for (std::size_t k = 0; k < collisions; ++k) {
      MeasuredCollision c;
      c.number = static_cast<int>(k) + 1;
      c.leg = static_cast<int>(k % 8);
      c.time = 0.21 * static_cast<double>(k);
      c.position = 0.1163 * static_cast<double>(k);
      c.omega_minus = 5.4;
      if (speeds_after) c.omega_plus = 3.6;
      trial.collisions.push_back(c);
    }
    e.trials.push_back(std::move(trial));
  }
  return e;
}

inline EffectTerm term(const TransitionModel& model, const std::string& id, std::vector<double> variant,
                       std::vector<double> values) {
  for (const Candidate& candidate : model.candidates())
    if (candidate.id == id) return {&candidate, std::move(variant), std::move(values)};
  throw std::invalid_argument("no candidate " + id);
}

/// Returns the verdict and the causes alone: the rest of diagnose() takes as long again.
inline Diagnosis decided(const TransitionModel& model, const DiagnosisOptions& options) {
  return decide_each(model, options, {options.rules}).front();
}

}  // namespace metastable::analysis::test
