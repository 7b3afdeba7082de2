#pragma once
// From a return map's exact kernel to a chain on Gauss-Legendre nodes (Nystroem).

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "markov/discretization.h"
#include "markov/return_map.h"
#include "markov/state_space.h"

namespace metastable::markov {

/// Gauss-Legendre nodes on panels of an interval per phase; states are numbered phase by phase, ascending. Panel edges
/// lie at the squares of equal steps: close together near the lower edge, where survivors and rest meet.
class NodeSpace {
 public:
  static constexpr std::size_t order = 16;  ///< nodes a panel

  /// @param range  {lower, upper} edge of each phase, finite, ascending
  /// @param panels  per phase, >= 1
  /// @throws std::invalid_argument otherwise
  NodeSpace(std::vector<std::pair<double, double>> range, std::size_t panels);

  int phases() const { return static_cast<int>(range_.size()); }
  std::size_t panels() const { return panels_; }
  std::size_t nodes() const { return panels_ * order; }  ///< per phase
  std::size_t size() const { return node_.size(); }
  double node(std::size_t state) const { return node_[state]; }
  double weight(std::size_t state) const { return weight_[state]; }
  /// Nodes of one phase.
  std::span<const double> nodes(int phase) const;
  std::span<const double> weights(int phase) const;
  int phase(std::size_t state) const { return static_cast<int>(state / nodes()); }
  /// The same range with another number of panels.
  NodeSpace with_panels(std::size_t panels) const { return {range_, panels}; }
  /// Cells as wide as the nodes' weights, one a node, in the same order (each node lies in its cell).
  StateSpace cells() const;

 private:
  std::vector<std::pair<double, double>> range_;
  std::size_t panels_;
  std::vector<double> node_, weight_;
};

/// A chain of exact rows, and how well the nodes resolve them.
struct IntegratedChain {
  SampledChain chain;    ///< `chain.launch` by quadrature over the launch state
  double row_error = 0;  ///< largest |sum of a row - probability of surviving| before it was removed
};

/// Row i: weight_j * density(x_i -> x_j), kill rate: the map's rest_probability, nothing by subtraction. For a kernel
/// that is smooth on the panels all results converge faster than any power of their number; points of lesser smoothness
/// that move with the state (LandingDensity) leave an error of their own size times a power of the distance of the
/// nodes. Rows are scaled to sum to the probability of surviving: that removes the quadrature's error of the total,
/// keeps the period of a cyclic chain, and folds what lands beyond the upper edge back in proportion. Cost: size() *
/// nodes() densities. Deterministic for any number of threads.
/// @throws std::invalid_argument if the map tells no density or no rest probability (names the sampled method)
IntegratedChain integrate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads = 1);

/// Where one event from `state` at `phase` leads, as a launch.
Launch integrated_row(const AnyReturnMap& map, const NodeSpace& space, double state, int phase);

/// Ranges per phase (one upper edge) that hold all but 1e-13 of the survivors and 1e-9 of the launch's landings, found
/// on a coarse chain of exact rows; nothing if no state comes to rest with a probability that a double can hold.
/// @throws std::invalid_argument as integrate()
std::vector<std::pair<double, double>> node_ranges(const AnyReturnMap& map, const LaunchState& launch, int threads);

}  // namespace metastable::markov
