#pragma once
// Finds the extremes of a collision over everything that restitution and friction can be.

#include <utility>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Returns {infimum, supremum} of omega+^2 [rad^2/s^2] over the support of (eta, mu); -infinity where the foot can jam.
/// It takes a grid over the support that holds its ends and the law's breaks; each extreme is refined by Brent's
/// method along eta and mu in turn. Cost: about 0.1 ms.
std::pair<double, double> after_collision_range(const WheelMap& map, double state, int phase);

}  // namespace metastable::dynamics
