#pragma once
// Cuts the state axis into cells.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace metastable::markov {

/// Holds the cells [edge_i, edge_{i+1}) of one phase. States above the last edge count into the last cell, states below
/// the first (rounding only: survivors lie above it) into the first.
class Grid {
 public:
  /// @param edges strictly ascending, at least 2. @throws std::invalid_argument otherwise.
  explicit Grid(std::vector<double> edges);
  /// Makes n equal cells.
  static Grid uniform(double lower, double upper, std::size_t cells);

  std::size_t cells() const { return edges_.size() - 1; }
  double lower(std::size_t cell) const { return edges_[cell]; }
  double width(std::size_t cell) const { return edges_[cell + 1] - edges_[cell]; }
  double midpoint(std::size_t cell) const { return 0.5 * (edges_[cell] + edges_[cell + 1]); }
  std::span<const double> edges() const { return edges_; }
  /// Finds the cell of a state by a table look-up and a short scan, O(1).
  std::uint32_t cell(double state) const;

  /// Does sums[1 + cell(state[k])] += weight[k] for all k in order; a state of -infinity counts in sums[0].
  /// @throws std::domain_error if a state is not a number
  /// @param sums  size cells() + 1
  void tally(std::span<const double> state, std::span<const double> weight, std::span<double> sums) const;

  /// Splits every cell in two at its midpoint.
  Grid halved() const;

 private:
  std::vector<double> edges_;
  std::vector<double> upper_;         // edges above the cells; above the last a number that no state reaches
  std::vector<std::uint32_t> table_;  // bucket of the axis to the cell that its start lies in
  double table_scale_ = 0;
  // tally() uses these where no bucket holds two edges; bucket 0 stands for rest, the others follow.
  std::vector<std::int32_t> start_;  // 1 + cell
  std::vector<double> edge_;         // above that cell, as upper_
};

}  // namespace metastable::markov
