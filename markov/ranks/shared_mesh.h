#pragma once
// Shares one mesh across ranks: each lands its own nodes and keeps their rows, as a matrix of PETSc.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "markov/mesh/mesh_passage.h"
#include "markov/ranks/ranks.h"

typedef struct _p_Mat* Mat;

namespace metastable::markov {

/// The nodes and entries are those of Mesh with the same options, whatever the number of ranks; their order differs.
/// Nodes have numbers, those of rank 0 first. Ranks own blocks of 8 nodes an axis by a hash.
class SharedMesh {
 public:
  /// @throws on all ranks alike, as Mesh does; options.most_bytes are those of each rank
  SharedMesh(const BatchMap& map, std::vector<NoiseFrame> frames, std::span<const double> start,
             const MeshOptions& options, Ranks& ranks);
  ~SharedMesh();
  SharedMesh(const SharedMesh&) = delete;
  SharedMesh& operator=(const SharedMesh&) = delete;

  std::size_t size() const { return kill_.size(); }   ///< own nodes
  std::uint64_t nodes() const { return nodes_; }      ///< of all ranks
  std::uint64_t entries() const { return entries_; }  ///< of all ranks
  std::size_t own_entries() const { return diagonal_.value.size() + others_.value.size(); }
  int phases() const { return lattice_.phases(); }
  double cheapest_failure() const { return cheapest_failure_; }
  std::span<const double> kill() const { return kill_; }  ///< of own nodes, likewise below
  std::span<const double> leave() const { return leave_; }
  std::span<const double> start() const { return start_; }  ///< shares of the start
  int phase(std::size_t node) const { return NodeLattice::phase(key_[node]); }
  std::uint64_t key(std::size_t node) const { return key_[node]; }
  std::vector<double> state(std::size_t node) const { return lattice_.state(key_[node]); }
  Ranks& ranks() const { return ranks_; }

  /// Serves follow_survivors(), by all ranks together.
  MassRows rows() const;
  /// Compute y = x Q and y = Q x on own nodes, by all ranks together.
  void apply_left(std::span<const double> x, std::span<double> y) const;
  void apply(std::span<const double> x, std::span<double> y) const;
  Mat matrix() const { return matrix_; }

 private:
  struct Entries {  ///< compressed rows, as PETSc takes them
    std::vector<int> row_start{0}, column;
    std::vector<double> value;
  };
  void take_rows(MeshGrowth& growth);
  std::vector<double> numbers_of_others(const MeshGrowth& growth, double first);
  void take_start(const MeshGrowth& growth, std::span<const double> start);

  Ranks& ranks_;
  NodeLattice lattice_;
  std::vector<std::uint64_t> key_;
  std::vector<double> kill_, leave_, start_;
  Entries diagonal_, others_;
  Mat matrix_ = nullptr;
  std::uint64_t nodes_ = 0, entries_ = 0;
  double cheapest_failure_ = 0;
};

}  // namespace metastable::markov
