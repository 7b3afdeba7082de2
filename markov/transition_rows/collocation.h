#pragma once
// Makes the backward form of integrated rows, for any noise: it collocates the expected steps over the start.

#include <limits>
#include <utility>
#include <vector>

#include "markov/transition_rows/node_rows.h"

namespace metastable::markov {

/// Row i holds the expectations, over the landing from node i, of the polynomials that are 1 at one node and 0 at the
/// others of its panel (AnyReturnMap::landing_points). Jumps and peaks of the landing's distribution do no harm: only
/// the expected steps, as a function of the start, have to be smooth between the edges of `space`, and may be like
/// square roots beside them. Entries have both signs (Chain::interpolated). Cost: size() rows of the map's points.
/// @throws std::invalid_argument if the map tells no points (names the sampled method)
IntegratedChain collocate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads = 1);

/// Returns where a launch leads by collocate()'s rows.
/// @param halvings  of launch_points()
Launch collocated_launch(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int halvings = 0,
                         int threads = 1);

/// Finds ranges per phase (one upper edge) that hold all but 1e-13 of the survivors and 1e-9 of the launch's landings,
/// found on cells; nothing if no state comes to rest with a probability that a double can hold.
/// @throws std::invalid_argument as collocate()
std::vector<std::pair<double, double>> collocation_ranges(const AnyReturnMap& map, const LaunchState& launch,
                                                          int threads,
                                                          double bulk = std::numeric_limits<double>::infinity());

/// Finds edges for NodeSpace: the states within `ranges` from which extreme landings just come to rest, and,
/// `generations` - 1 times, those from which extreme landings meet such a state; no generation that takes a phase
/// beyond `most` edges, but for the first. As many for every phase (wide panels are halved). Beyond `bulk` over the
/// lower edge, edges at equal ratios as well.
std::vector<std::vector<double>> collocation_edges(const AnyReturnMap& map,
                                                   const std::vector<std::pair<double, double>>& ranges,
                                                   int generations,
                                                   double bulk = std::numeric_limits<double>::infinity());

}  // namespace metastable::markov
