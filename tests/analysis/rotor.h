#pragma once
// Makes a rotor coasting down, for the tests of the diagnosis.

#include "analysis/experiment/experiment.h"

namespace metastable::analysis::test {

/// Returns sixteen runs of 40 revolutions from 13, 18, 23 and 28 rad/s, their speeds still to be drawn.
inline Experiment coasting_rotor() {
  Experiment e;
  e.system = System::coast_down;
  e.loss = {0.15, 0, 0.00165, 0.02};
  e.rotor_inertia = 1;
  e.conditions = {{"runs", 0, 0, {}, 0}};
  for (int t = 0; t < 16; ++t) {
    MeasuredTrial trial;
    trial.number = t + 1;
    for (int k = 0; k < 40; ++k)
      trial.collisions.push_back({.number = k + 1,
                                  .leg = {},
                                  .time = {},
                                  .position = {},
                                  .omega_minus = 28.0 - 5.0 * (t % 4),
                                  .omega_plus = {}});
    e.trials.push_back(trial);
  }
  return e;
}

}  // namespace metastable::analysis::test
