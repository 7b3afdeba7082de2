#pragma once
// Takes states of a continuous phase as nodes of quadrature and interpolation.

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "markov/transition_rows/state_space.h"

namespace metastable::markov {

/// Holds Gauss-Legendre nodes on panels of an interval per phase; states are numbered phase by phase, ascending. Panel
/// edges lie at the squares of equal steps: close together near the lower edge, where survivors and rest meet; beyond
/// the bulk, if one is given, at equal ratios.
class NodeSpace {
 public:
  static constexpr std::size_t order = 16;  ///< nodes a panel

  /// @param range  {lower, upper} edge of each phase, finite, ascending
  /// @param panels  per phase, >= 1
  /// @param bulk  width over the lower edge, > 0
  /// @throws std::invalid_argument otherwise
  NodeSpace(std::vector<std::pair<double, double>> range, std::size_t panels,
            double bulk = std::numeric_limits<double>::infinity());

  /// Suits functions with square roots or kinks at `edges`: there are `panels` panels between every two edges, where
  /// x = a + (b - a) sin^2(pi t / 2) and t is what is divided.
  /// @param edges  per phase, as many for each, ascending
  /// @throws std::invalid_argument otherwise
  static NodeSpace between(std::vector<std::vector<double>> edges, std::size_t panels);

  int phases() const { return static_cast<int>(range_.size()); }
  std::size_t panels() const { return panels_; }
  std::size_t nodes() const { return panels_ * order; }  ///< per phase
  std::size_t size() const { return node_.size(); }
  double node(std::size_t state) const { return node_[state]; }
  std::span<const double> states() const { return node_; }  ///< nodes of all phases
  double weight(std::size_t state) const { return weight_[state]; }
  /// Returns the nodes of one phase.
  std::span<const double> nodes(int phase) const;
  std::span<const double> weights(int phase) const;
  int phase(std::size_t state) const { return static_cast<int>(state / nodes()); }
  /// Returns the same ranges, without edges, with another number of panels.
  NodeSpace with_panels(std::size_t panels) const { return NodeSpace(range_, panels, bulk_); }
  std::span<const double> edges(int phase) const;  ///< as given
  /// Finds, where `edges` were given, the panel that holds a state, and the place there in [-1, 1]. States outside
  /// are moved to the nearest edge.
  std::pair<std::size_t, double> locate(int phase, double state) const;
  /// Makes cells as wide as the nodes' weights, one a node, in the same order (each node lies in its cell).
  StateSpace cells() const;

 private:
  NodeSpace() = default;
  std::vector<std::pair<double, double>> range_;
  std::size_t panels_ = 0;
  double bulk_ = std::numeric_limits<double>::infinity();
  std::size_t divided_ = 0;                 // panels between two edges
  std::vector<std::vector<double>> edges_;  // if given
  std::vector<double> node_, weight_;
};

/// Says where `share` in [0, 1] of the panels of a range end: quadratic up to the bulk, exponential from there on, with
/// one slope.
double graded_edge(std::pair<double, double> range, double bulk, double share);

/// Holds the Legendre polynomials P_0 .. P_15 at t in [-1, 1].
using Legendre = std::array<double, NodeSpace::order>;
Legendre legendre(double t);
/// Does the same at `lanes` places side by side.
template <std::size_t lanes>
void legendre(const double* t, Legendre* values) {
  double before[lanes], here[lanes];
  for (std::size_t l = 0; l < lanes; ++l) {
    values[l][0] = before[l] = 1;
    values[l][1] = here[l] = t[l];
  }
  for (std::size_t n = 1; n + 1 < NodeSpace::order; ++n) {
    const auto d = static_cast<double>(n);
    const double up = (2 * d + 1) / (d + 1), down = d / (d + 1);
    for (std::size_t l = 0; l < lanes; ++l) {
      const double next = up * t[l] * here[l] - down * before[l];
      before[l] = here[l];
      values[l][n + 1] = here[l] = next;
    }
  }
}
/// Returns the Gauss-Legendre rule on [-1, 1], ascending; k < NodeSpace::order.
double gauss_abscissa(std::size_t k);
double gauss_weight(std::size_t k);

}  // namespace metastable::markov
