#pragma once
// Makes a return map of one to four dimensions a sparse chain: nodes of a lattice in the principal axes of its noise,
// as far as failures are worth it.

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/mesh/batch_map.h"
#include "markov/mesh/node_lattice.h"
#include "markov/mesh/noise_frame.h"

namespace metastable::markov {

/// Says that no failure was found as far as meshes look: within an action of 60.
class NoFailureFound : public MapError {
 public:
  using MapError::MapError;
};

/// A further state of phase 0 that a mesh grows from.
struct MeshSource {
  std::vector<double> state;
  double action = 0;  ///< with which it starts, >= 0
};

struct MeshOptions {
  double spacing = 0.5;  ///< of the nodes, in stationary sds of the noise; in (0, 2]
  std::uint64_t seed = 1;
  std::uint32_t shift = 0;     ///< which random shift of the lattice of nodes
  double margin = 12;          ///< nodes as far as the action of the cheapest failure and this
  double score_spacing = 0.6;  ///< of places on a curve in the first score, and of the lattice of the others
  double score_reach = 8.5;
  std::size_t most_bytes = std::size_t{3} << 30;  ///< for rows and nodes; more is refused
  std::function<void()> on_batch = {};            ///< is called after every few nodes; may throw to stop
  std::vector<MeshSource> sources = {};           ///< other gaits (OtherGaits)
  double start_action = 0;                        ///< of the start and its orbit
  double limit = 0;                               ///< > 0: nodes as far as this action, wherever failures are
  /// Reads the row of a node off so many states around it instead of its own (of several scores, one for each line of
  /// theirs), spread as far as the landings that it stands for: where failing jumps between neighbours, a node that
  /// stood for one side alone would put the jump half a spacing off, by chance. >= 1
  int row_states = 1;
  /// States of phase 0 whose actions are asked for: if there are any, it grows until they and a failure are met.
  std::vector<std::vector<double>> targets = {};
};

/// Rows are interpolated: a landing is shared among the nodes around it in proportion to nearness on every axis, so
/// entries are never negative and means are exact; the sharing acts as noise of h^2/6 an axis and step, and expected
/// steps come out low by a smooth error in h^2. Landings are read as curves in the first score (ScoreCurve) and
/// integrated along them; further scores stand on a lattice with an offset of its own for every node.
///
/// The mesh grows from the start and the noise-free orbit by least action: the chain's own, -ln of an entry against the
/// largest of its row, by Dijkstra's algorithm, up to the cheapest failure and `margin` beyond. What leaves the mesh is
/// kept apart. Cost: some twenty steps of the map a curve, fewer the nearer a node is to the
/// limit.
class Mesh {
 public:
  /// @param start  a state at phase 0
  /// @throws MapError as checked_step does; NoFailureFound when no failure is met within an action of 60
  /// @throws std::invalid_argument for options out of range
  /// @throws std::length_error when it would take more memory than allowed: says how much for how many nodes
  Mesh(const BatchMap& map, std::vector<NoiseFrame> frames, std::span<const double> start, const MeshOptions& options);

  std::size_t size() const { return kill_.size(); }
  std::size_t entries() const { return column_.size(); }
  /// Says what growing it takes at most, rows and nodes.
  std::size_t bytes() const { return bytes_; }
  int phases() const { return lattice_.phases(); }
  double cheapest_failure() const { return cheapest_failure_; }  ///< its action; exp(-action) is its order of rarity
  std::span<const double> kill() const { return kill_; }
  std::span<const double> leave() const { return leave_; }  ///< probability of leaving the mesh
  std::span<const std::uint32_t> columns(std::size_t row) const {
    return {column_.data() + row_start_[row], row_start_[row + 1] - row_start_[row]};
  }
  std::span<const double> values(std::size_t row) const {
    return {value_.data() + row_start_[row], row_start_[row + 1] - row_start_[row]};
  }
  /// Return phase and state of a node.
  int phase(std::size_t node) const { return NodeLattice::phase(key_[node]); }
  std::vector<double> state(std::size_t node) const { return lattice_.state(key_[node]); }
  /// Returns the node one further on an axis; NodeTable::none where that is not part of the mesh.
  std::uint32_t neighbour(std::size_t node, std::size_t axis) const {
    return table_.find(key_[node] + NodeLattice::axis_key(axis));
  }

  /// Holds the nodes around a state with their weights; nodes that are not part of the mesh are left out.
  struct Corners {
    std::array<std::uint32_t, 5> node{};
    std::array<double, 5> weight{};
    int count = 0;
  };
  Corners corners(int phase, std::span<const double> state) const;

  /// Compute y = x Q and y = Q x, diagonals included. O(entries).
  void apply_left(std::span<const double> x, std::span<double> y) const;
  void apply(std::span<const double> x, std::span<double> y) const;

  /// Returns it as a chain for the other solvers; what leaves the mesh counts as failed.
  Chain chain() const;

 private:
  NodeLattice lattice_;
  NodeTable table_;
  std::vector<std::uint64_t> key_;  ///< phase and place of each node
  std::vector<std::size_t> row_start_{0};
  std::vector<std::uint32_t> column_;
  std::vector<double> value_, kill_, leave_;
  double cheapest_failure_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace metastable::markov
