#include "analysis/wheel_model/wheel_columns.h"

namespace metastable::analysis {
namespace {

Experiment with_speeds_after(Experiment experiment) {
  experiment.columns.omega_plus = Presence::all;
  if (!(experiment.sensor.noise_sd.value_or(0) > 0)) experiment.sensor.noise_sd = imagined_noise;
  for (MeasuredTrial& trial : experiment.trials)
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      const bool rested = trial.outcome == dynamics::Outcome::rest && k + 1 == trial.collisions.size();
      if (!rested) trial.collisions[k].omega_plus = trial.collisions[k].omega_minus;  // to be drawn anew
    }
  return experiment;
}

}  // namespace

Experiment with_legs_from_the_first(Experiment experiment) {
  experiment.columns.leg = Presence::all;
  const int legs = experiment.wheel.legs();
  for (MeasuredTrial& trial : experiment.trials)
    for (std::size_t k = 0; k < trial.collisions.size(); ++k)
      trial.collisions[k].leg = (experiment.conditions[trial.condition].first_landing_leg + static_cast<int>(k)) % legs;
  return experiment;
}

std::vector<std::pair<std::string, Experiment>> completed_experiments(const Experiment& experiment) {
  std::vector<std::pair<std::string, Experiment>> all;
  if (experiment.columns.leg != Presence::all) all.emplace_back("leg", with_legs_from_the_first(experiment));
  if (experiment.columns.omega_plus != Presence::all)
    all.emplace_back("omega_plus_rad_s", with_speeds_after(experiment));
  return all;
}

}  // namespace metastable::analysis
