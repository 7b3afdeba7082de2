#pragma once
// Holds what is supposed of a wheel whose trials were measured: its contact and the effects added to it.

#include <optional>

#include "analysis/likelihood/score_tilt.h"
#include "dynamics/wheel/collision_density.h"
#include "dynamics/wheel/extended_wheel.h"

namespace metastable::analysis {

struct WheelHypothesis {
  dynamics::ContactSpread contact;
  ScoreTilt tilt;  ///< change of shape of what a collision's spread gives
  dynamics::Extension extension;
  std::optional<double> noise = {};  ///< sd of reported speeds [rad/s]; none: what the runs say
};

}  // namespace metastable::analysis
