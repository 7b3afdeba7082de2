#pragma once
// The rimless wheel in a rigid-body engine (ODE) as a reality that shares nothing with the models of this tree.

#include <cstdint>

#include "analysis/experiment/experiment.h"

namespace metastable::test {

/// Says what is run. The wheel is the paper's with J = 0.0025 kg m^2 and tips of 0.5 mm, restitution 0.40 +- 0.05 and
/// friction 0.40 +- 0.03 by foothold, on ramps of 9.59 deg (fast and slow) and 7.02 deg.
struct EngineRun {
  int trials = 12;  ///< of each of three conditions
  std::uint64_t seed = 1;
  double viscous_drag = 0;  ///< at the axle [N m s]
  int odd_leg = -1;         ///< whose friction is multiplied by friction_ratio; -1: none
  double friction_ratio = 1;
  double memory = 0;  ///< correlation of restitution, and of friction, between one foothold and the next
};

/// Steps the engine 20,000 times a second and writes down what a perfect sensor sees: the speed when a tip touches, the
/// speed when it first leaves the ground again, and where it touched. The nominal model of the experiment is `settled`
/// with the numbers above.
analysis::Experiment engine_experiment(const EngineRun& run);

}  // namespace metastable::test
