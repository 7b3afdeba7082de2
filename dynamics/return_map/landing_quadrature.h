#pragma once
// Turns a landing into points with weights, for expectations of functions of the next state, whatever the noise.

#include <span>
#include <vector>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Finds points with E[f(x')] = sum of weight * f(next), for the landing x' of a wheel that meets the collision at
/// `phase` with x = omega^2 [rad^2/s^2] = state, > 0, and survives it. f is smooth between `breaks` (ascending), and
/// may be like a square root beside them.
///
/// `published` and `coulomb` with independent eta and mu, each with or without a spread, take Gauss-Legendre over eta
/// and mu, with panels that end where the loss crosses a break or rest (in mu its two roots; in eta where these appear,
/// with the square root taken out there). Collisions that stick (`coulomb`, mu >= mu_c) are one point an eta. A list of
/// contacts and `plastic` take a point a contact. No weight is negative; relative accuracy about 1e-11, down to tails
/// of e^-70. Cost: some thousand points with two spreads, some hundred with one; 0.2 to 1 ms, 10 us.
/// @return the probability of rest, whose share over mu comes from the distribution function
/// @throws std::invalid_argument for correlated eta and mu (names the reason and the sampled method)
double landing_points(const WheelMap& map, double state, int phase, std::span<const double> breaks,
                      std::vector<std::pair<double, double>>& points);

/// Lists states before the collision at `phase`, ascending, from which an extreme landing is one of `next`: where
/// expectations of a function that is not smooth at `next` are not smooth themselves. Extreme: at a bound of eta or mu,
/// where the loss is largest or least in mu (constant mu: in eta), or where the foot begins to stick. Bounds of eta and
/// mu that are more than 12 sds away do not count, nor does eta = 0 under `published`, where the contact lasts for
/// ever.
std::vector<double> states_of_extremes(const WheelMap& map, int phase, std::span<const double> next);

}  // namespace metastable::dynamics
