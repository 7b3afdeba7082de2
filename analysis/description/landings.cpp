#include "analysis/description/landings.h"

#include <algorithm>

namespace metastable::analysis {
namespace {

bool wanted(const std::vector<std::size_t>& conditions, std::size_t condition) {
  return std::find(conditions.begin(), conditions.end(), condition) != conditions.end();
}

MeasuredLanding start(const MeasuredTrial& trial, const MeasuredCollision& c, const dynamics::WheelMap& map) {
  return {trial.condition, map.phases() == 1 ? 0 : *c.leg % map.phases(), c.omega_minus * c.omega_minus, {}, false};
}

}  // namespace

bool legs_known(const Experiment& experiment) {
  return experiment.wheel.equal_legs() || experiment.columns.leg == Presence::all;
}

dynamics::Wheel fitted_wheel(const Experiment& experiment) {
  dynamics::Wheel wheel = experiment.wheel;
  if (!legs_known(experiment)) std::fill(wheel.leg_length.begin(), wheel.leg_length.end(), wheel.mean_leg_length());
  return wheel;
}

std::vector<MeasuredLanding> step_landings(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                                           const std::vector<dynamics::WheelMap>& maps) {
  std::vector<MeasuredLanding> all;
  for (const MeasuredTrial& trial : experiment.trials) {
    if (!wanted(conditions, trial.condition)) continue;
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      MeasuredLanding t = start(trial, trial.collisions[k], maps[trial.condition]);
      if (k + 1 < trial.collisions.size()) {
        const double next = trial.collisions[k + 1].omega_minus;
        t.landing = next * next;
      } else if (trial.outcome) {
        t.rested = *trial.outcome == dynamics::Outcome::rest;
      } else {
        continue;
      }
      all.push_back(t);
    }
  }
  return all;
}

std::vector<MeasuredLanding> collision_landings(const Experiment& experiment,
                                                const std::vector<std::size_t>& conditions,
                                                const std::vector<dynamics::WheelMap>& maps) {
  std::vector<MeasuredLanding> all;
  for (const MeasuredTrial& trial : experiment.trials) {
    if (!wanted(conditions, trial.condition)) continue;
    for (const MeasuredCollision& c : trial.collisions) {
      if (!c.omega_plus) continue;
      MeasuredLanding t = start(trial, c, maps[trial.condition]);
      const dynamics::Stance& stance = maps[trial.condition].stance(t.phase);
      const double after = *c.omega_plus * *c.omega_plus;
      t.rested = after < stance.barrier;
      if (!t.rested) t.landing = after + stance.gain;
      all.push_back(t);
    }
  }
  return all;
}

}  // namespace metastable::analysis
