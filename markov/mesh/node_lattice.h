#pragma once
// Keeps the nodes of a mesh: a lattice in the principal axes of the noise, phase by phase, each node with its own key.

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "markov/mesh/noise_frame.h"

namespace metastable::markov {

/// Holds the corners of a simplex of nodes and what share of a point inside each of them takes; the first dimension + 1
/// count.
struct NodeSimplex {
  std::array<std::uint64_t, 5> key{};
  std::array<double, 5> weight{};
};

class NodeLattice {
 public:
  /// Holds a landing in units of the spacing; coordinates beyond the dimension are 0.
  using Point = std::array<double, 4>;

  NodeLattice() = default;
  /// @param shift  of the lattice, in units of the spacing
  NodeLattice(std::vector<NoiseFrame> frames, double spacing, const Point& shift);

  int phases() const { return static_cast<int>(frames_.size()); }
  std::size_t dimension() const { return frames_.front().centre.size(); }
  const NoiseFrame& frame(int phase) const { return frames_.at(static_cast<std::size_t>(phase)); }
  static int phase(std::uint64_t key);
  /// Returns what keys of one block of nodes, 8 along an edge, have in common.
  static std::uint64_t block(std::uint64_t key);
  std::vector<double> state(std::uint64_t key) const;
  /// Returns whether nodes reach as far as this state of a phase.
  bool locate(int phase, const double* state, Point& point) const;
  /// Finds the cell of 2^dimension nodes around a point: the key of its lowest corner, and how far beyond that the
  /// point lies on each axis, in [0, 1). A corner one further on axis k has the lowest one's key + axis_key(k).
  std::uint64_t find_cell(int phase, const Point& point, Point& fraction) const;
  static std::uint64_t axis_key(std::size_t k);
  /// Finds Kuhn's simplex around a point; bit k of `flips` turns axis k around.
  void find_simplex(int phase, const Point& point, unsigned flips, NodeSimplex& out) const;

 private:
  std::vector<NoiseFrame> frames_;
  double spacing_ = 0;
  Point shift_{};
};

/// Leads by open addressing from keys to numbers of nodes.
class NodeTable {
 public:
  static constexpr std::uint32_t none = 0xffffffffU;
  std::uint32_t find(std::uint64_t key) const;
  /// Starts to fetch the slot from memory in which a key will be looked for soon; changes nothing.
  void fetch(std::uint64_t key) const {
    if (!slot_.empty()) __builtin_prefetch(&slot_[first_slot(key, slot_.size())]);
  }
  /// Returns where to look first for a key in a table of a power of two slots, 2 to 2^32: the highest bits of a
  /// product, on which all bits of the key bear. Lower ones know the last axes alone.
  static std::size_t first_slot(std::uint64_t key, std::size_t slots) {
    return static_cast<std::size_t>((key * 0x9e3779b97f4a7c15ULL) >> (64 - std::countr_zero(slots)));
  }
  void insert(std::uint64_t key, std::uint32_t node);
  std::size_t bytes() const { return slot_.capacity() * sizeof(slot_[0]); }

 private:
  std::vector<std::pair<std::uint64_t, std::uint32_t>> slot_;
  std::size_t used_ = 0;
};

}  // namespace metastable::markov
