#pragma once
// Holds what is supposed of a wheel whose trials were measured: its contact and the effects added to it.

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "analysis/wheel_model/contact_variation.h"
#include "analysis/wheel_model/score_tilt.h"
#include "dynamics/extended_wheel/extended_wheel.h"
#include "dynamics/step_density/collision_density.h"

namespace metastable::analysis {

struct WheelHypothesis {
  dynamics::ContactSpread contact;
  ScoreTilt tilt;  ///< change of shape of what a collision's spread gives
  dynamics::Extension extension;
  std::optional<double> noise = {};         ///< sd of reported speeds [rad/s]; none: what the runs say
  std::vector<double> friction_shift = {};  ///< by condition: what its day adds to the mean of mu; empty: one day

  /// Changes the friction of a step by where it happens; none: it does not vary by what has no name.
  std::function<void(const CollisionPlace&, dynamics::StepContext&)> varied = {};

  double shift_of(std::size_t condition) const { return friction_shift.empty() ? 0 : friction_shift[condition]; }
};

}  // namespace metastable::analysis
