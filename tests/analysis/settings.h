#pragma once
// Makes settings that several tests share.

#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Returns the paper's wheel with its legs, or with eight equal ones of 0.1519 m.
inline Setting paper_setting(double slope_deg, bool equal_legs) {
  Setting setting;
  setting.slope_deg = slope_deg;
  setting.initial_speed = *paper_launch(slope_deg);
  if (equal_legs) setting.wheel.leg_length.assign(8, 0.1519);
  return setting;
}

/// Has `coulomb` at 3.0 deg, where it may rest: equal legs of 0.1519 m, omega_0 ~ N(4.5, 0.2^2), eta, mu ~ N(0.4,
/// 0.1^2).
inline Setting gentle_coulomb() {
  Setting setting;
  setting.slope_deg = 3.0;
  setting.law = dynamics::Law::coulomb;
  setting.initial_speed = {4.5, 0.2};
  setting.wheel.leg_length.assign(8, 0.1519);
  return setting;
}

}  // namespace metastable::analysis
