#pragma once
// Grows a mesh, on one process or shared by ranks: a rank lands its own nodes and tells the others of theirs.

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "markov/mesh/mesh.h"
#include "markov/mesh/node_lattice.h"
#include "markov/mesh/score_curve.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {

/// Returns the lattice of a mesh. @throws std::invalid_argument for options out of range, and phases without a frame
NodeLattice mesh_lattice(const BatchMap& map, std::vector<NoiseFrame> frames, const MeshOptions& options);

/// Carries what ranks that share a mesh say to one another; all of them call the same function at the same time.
class Exchange {
 public:
  struct Note {
    std::uint64_t key = 0;
    double value = 0;
  };
  virtual ~Exchange() = default;
  virtual int rank() const = 0;
  virtual int ranks() const = 0;
  virtual double sum(double own) = 0;
  virtual double largest(double own) = 0;
  /// Sends to[r] to rank r; returns what each rank sent here.
  virtual std::vector<std::vector<Note>> swap(const std::vector<std::vector<Note>>& to) = 0;
  /// Returns the first text of any rank that is not empty, in the order of ranks.
  virtual std::string first_text(const std::string& own) = 0;
};

/// Grows by least action in waves: the nodes of one action (to 1) are landed, then their actions are followed in
/// rounds, in each of which every node speaks with the action it had when the round began. So neither the order of
/// nodes nor the number of ranks changes which nodes and entries there are. Blocks of nodes belong to ranks by a hash.
class MeshGrowth {
 public:
  static constexpr double farthest = 60;  ///< action beyond which failures are not looked for
  static constexpr std::size_t entry_bytes = sizeof(std::uint32_t) + sizeof(double);

  /// @param exchange  of the ranks; nullptr: one process
  MeshGrowth(const BatchMap& map, const NodeLattice& lattice, const MeshOptions& options, Exchange* exchange = nullptr);
  /// Grows from a state at phase 0 and the noise-free orbit.
  /// @throws MapError, std::length_error as Mesh does, on all ranks alike
  void grow_from(std::span<const double> start);

  /// Grows from one state at phase 0 alone. @throws as grow_from
  void grow_from_state(std::span<const double> state);
  /// Returns the least action of each of MeshOptions::targets; infinite where it was not met.
  std::vector<double> target_actions() const;

  /// Give the nodes that were met, by number, and rows of those that this process landed, in the order of landing.
  std::size_t nodes() const { return key_.size(); }
  std::size_t rows() const { return row_.size(); }
  std::uint64_t key(std::uint32_t node) const { return key_[node]; }
  std::uint32_t node(std::uint64_t key) const { return table_.find(key); }  ///< NodeTable::none: never met
  /// Returns the row of a node; `no_row` for those that were never landed or belong to other ranks.
  static constexpr std::uint32_t no_row = 0xffffffffU;
  std::uint32_t row(std::uint32_t node) const { return own_[node] ? row_of_[node] : no_row; }
  bool own(std::uint32_t node) const { return own_[node] != 0; }
  int owner(std::uint64_t key) const;
  std::uint32_t node_of_row(std::size_t row) const { return row_[row].node; }
  std::span<const std::uint32_t> columns(std::size_t row) const;
  std::span<const double> values(std::size_t row) const;
  double kill(std::size_t row) const { return row_[row].kill; }
  double leave(std::size_t row) const { return row_[row].leave; }
  double cheapest_failure() const { return cheapest_failure_; }
  std::size_t entries() const { return entries_; }
  std::size_t bytes() const;
  /// Gives back the memory of entries of all rows before this one.
  void forget_entries_before(std::size_t row);

 private:
  struct Row {
    std::uint32_t node = 0, chunk = 0, first = 0, last = 0;
    double largest = 0, kill = 0, leave = 0;
    double said = 0;  ///< action with which it last spoke to its followers
    bool again = false;
  };
  struct Chunk {
    std::vector<std::uint32_t> column;
    std::vector<double> value;
  };
  struct Lines {
    ScoreLines along;
    std::vector<double> weight;      ///< of each line, in one node's sum of about one
    std::vector<std::size_t> first;  ///< line of each node
  };
  using Parts = std::vector<std::pair<std::uint64_t, double>>;

  void start_from(int phase, std::span<const double> state, double action);
  void mark_targets();
  void grow();
  double limit() const;
  std::uint32_t node_at(std::uint64_t key);
  void expand_wave(std::vector<std::uint32_t>& wave);
  std::vector<double> row_states(std::uint32_t node, std::size_t count) const;
  double add_lines(std::uint32_t node, Lines& lines) const;
  void land(std::span<const std::uint32_t> nodes);
  void add_up(Parts& parts);
  void store(std::uint32_t node, Parts& parts, double failed, double away);
  void follow(std::vector<std::uint32_t> rows);
  void relax(const Row& row);
  void lower(std::uint32_t node, double to);
  void tell();
  std::vector<std::uint32_t> take_wave();
  void require_memory();
  double sum(double own) { return exchange_ ? exchange_->sum(own) : own; }
  double largest(double own) { return exchange_ ? exchange_->largest(own) : own; }

  const BatchMap& map_;
  const NodeLattice& lattice_;
  const MeshOptions& options_;
  Exchange* exchange_;
  std::optional<ScoreLattice> others_;  ///< of the scores but the first
  NodeTable table_;
  std::vector<std::uint64_t> key_;
  std::vector<double> action_;
  std::vector<std::uint32_t> row_of_;
  std::vector<std::uint8_t> own_;
  std::vector<Row> row_;
  std::vector<Chunk> chunk_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> place_of_;  ///< of add_up(): its number, and a place by key
  std::uint32_t added_up_ = 0;
  std::size_t entries_ = 0, forgotten_ = 0;
  std::vector<std::vector<std::uint32_t>> bucket_;
  std::size_t current_ = 0;
  std::vector<std::uint32_t> again_;      ///< rows
  std::vector<std::uint32_t> to_others_;  ///< nodes of other ranks whose action fell
  double cheapest_failure_ = std::numeric_limits<double>::infinity();
  std::vector<std::vector<std::uint32_t>> target_;  ///< nodes around each of MeshOptions::targets
};

}  // namespace metastable::markov
