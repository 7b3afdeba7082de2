#pragma once
// Builds a chain on nodes from its rows, however they are made.

#include <functional>
#include <span>
#include <vector>

#include "markov/transition_rows/discretization.h"
#include "markov/transition_rows/node_space.h"
#include "markov/transition_rows/return_map.h"

namespace metastable::markov {

/// Says where one state leads.
struct NodeRow {
  std::vector<double> landing;  ///< on the nodes of the next phase
  double rest = 0;
  double error = 0;  ///< of the sum of both, before it was removed
};
/// Makes a row; several threads call it at once.
using MakeNodeRow = std::function<NodeRow(double state, int phase)>;

/// Holds a chain of exact rows and says how well the nodes resolve them.
struct IntegratedChain {
  SampledChain chain;    ///< `chain.launch` by the coarsest launch_points()
  double row_error = 0;  ///< largest |sum of a row - probability of surviving| before it was removed
};

/// @param interpolated  entries may have any sign (Chain::interpolated)
/// @param kinks  states of the launch at which rows have kinks
IntegratedChain chain_of_rows(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch,
                              const MakeNodeRow& make_row, bool interpolated, std::span<const double> kinks,
                              int threads);

struct LaunchPoint {
  double score, weight;
};
/// Cuts the launch's score by the trapezoidal rule, exact to rounding for densities wider than a third of the launch's
/// spread; by panels where rows, as functions of the state, have kinks at some of `states`. A launch that spreads wider
/// than its landings wants halvings, until what is asked of it settles.
/// @param halvings  of the rule's steps or panels
std::vector<LaunchPoint> launch_points(const LaunchState& launch, std::span<const double> states, int halvings = 0);

/// Where survivors are still at the upper edge of a range so many times as long as the first try, their states grow
/// without limit.
inline constexpr double most_growth = 1e6;

/// Says where survivors are, by state; where their iteration does not settle, because cells that only a fast launch
/// passes keep as many as the others, where the trials of a launch that leads to `after` go (both sum to one a phase at
/// most).
std::vector<double> survivors_or_visits(const Chain& chain, std::span<const double> after);

/// Finds where the launch leads, by launch_points().
Launch launch_of_rows(const MakeNodeRow& make_row, const NodeSpace& space, const LaunchState& launch,
                      std::span<const double> kinks, int halvings, int threads);

}  // namespace metastable::markov
