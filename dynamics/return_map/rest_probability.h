#pragma once
// Finds the probability that one collision brings the wheel to rest, tails included.

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Returns P(rest) of a wheel that meets the collision at `phase` with x = omega^2 [rad^2/s^2] = state, > 0.
///
/// A list of contacts is counted. Independent (eta, mu): for each eta the set of mu that rests is found from the roots
/// of omega+^2 - barrier, with the distribution function of mu in closed form; over eta by adaptive Gauss-Kronrod
/// quadrature to about 1e-10 of the result, however small that is (down to about 1e-290). A constant mu makes it a set
/// of eta.
/// @throws std::logic_error for correlated (eta, mu), for which there is no closed form.
/// Cost: a few hundred to a few thousand values of eta at 2 us each, 0.3 to 5 ms.
double rest_probability(const WheelMap& map, double state, int phase);

}  // namespace metastable::dynamics
