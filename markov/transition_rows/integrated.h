#pragma once
// Turns a return map's exact kernel into a chain on Gauss-Legendre nodes (Nystroem).

#include <limits>
#include <utility>
#include <vector>

#include "markov/transition_rows/node_rows.h"

namespace metastable::markov {

/// Row i holds weight_j * density(x_i -> x_j), its kill rate is the map's rest_probability. For a kernel
/// that is smooth on the panels all results converge faster than any power of their number; points of lesser smoothness
/// that move with the state (LandingDensity) leave an error of their own size times a power of the distance of the
/// nodes. Rows are scaled to sum to the probability of surviving: that removes the quadrature's error of the total,
/// keeps the period of a cyclic chain, and folds what lands beyond the upper edge back in proportion. Costs size() *
/// nodes() densities; threads change no bit.
/// @throws std::invalid_argument if the map tells no density or no rest probability (names the sampled method)
IntegratedChain integrate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads = 1);

/// Returns where a launch leads by integrate()'s rows.
/// @param halvings  of launch_points()
Launch integrated_launch(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int halvings = 0,
                         int threads = 1);

/// Finds ranges per phase (one upper edge) that hold all but 1e-13 of the survivors and 1e-9 of the launch's landings,
/// found on a coarse chain of exact rows; nothing if no state comes to rest with a probability that a double can hold.
/// @param bulk  of the NodeSpace that they are for
/// @throws std::invalid_argument as integrate()
std::vector<std::pair<double, double>> node_ranges(const AnyReturnMap& map, const LaunchState& launch, int threads,
                                                   double bulk = std::numeric_limits<double>::infinity());

}  // namespace metastable::markov
