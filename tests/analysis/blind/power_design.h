#pragma once
// The experiment of which tests ask how visible effects are.

#include "analysis/blind/effect_power.h"

namespace metastable::analysis::test {

/// A steep ramp and a contact with which trials last, seen exactly, feet on the ground.
/// @param trials  >= 1
inline PowerDesign steep_ramp(int trials) {
  PowerDesign design;
  Setting base;
  base.restitution = {0.54, 0.045};
  base.friction = {0.352, 0.043};
  base.slope_deg = 9.59;
  base.initial_speed = {5.83, 0.28};
  design.conditions = {{"fast", base, trials}};
  design.laboratory.flight = false;
  return design;
}

}  // namespace metastable::analysis::test
