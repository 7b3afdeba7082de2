#pragma once
// Says between which speeds a rimless wheel rolls: what lies far outside is in another unit.

#include <cstddef>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

struct RollingSpeeds {
  /// The share of an ideal wheel's least speed that others may have whose feet slide or hop. Of 60,000 landings of
  /// four rigid-body engines and of the virtual laboratory none was below 0.99 of it.
  static constexpr double room = 0.7;
  /// The `room` of what a wheel reaches before a collision once it has come over a leg: it fell from rest over the
  /// foot, I omega^2 / 2 = M g L (1 - cos(alpha/2 + gamma)). Units that are too small by 2 pi (rev/s) lie below
  /// [rad/s].
  double slowest = 0;
  /// Above this feet leave the ramp, omega^2 L > g [rad/s].
  double lifting = 0;
  /// Three times `lifting`: a foot would have to be pulled down with eight times the wheel's weight. Units that are
  /// too large (deg/s: 57 times, rpm: 9.5 times) lie above [rad/s].
  double fastest = 0;
};

/// @param condition  index, of a rimless wheel
RollingSpeeds rolling_speeds(const Experiment& experiment, std::size_t condition);

/// Returns by how much gravity raises omega^2 in a stance [rad^2/s^2], 4 g sin(alpha/2) sin(gamma) / L, if all mass of
/// the wheel is in its hub; with more inertia it is less. @param slope  gamma [rad]
double most_stance_gain(const dynamics::Wheel& wheel, double slope);

}  // namespace metastable::analysis
