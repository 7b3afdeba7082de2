#pragma once
// Reads what to split by off a mesh: the chance of failing within a window, which the mesh finds backwards from
// failure.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "markov/mesh/batch_map.h"
#include "markov/splitting/weighted_ensemble.h"

namespace metastable::markov {

struct MeshLevelOptions {
  double spacing = 0;  ///< of the nodes, in stationary sds of the noise, in (0, 2]; 0: 1
  double margin = 6;   ///< MeshOptions::margin
  std::uint64_t seed = 1;
  std::size_t most_bytes = std::size_t{3} << 30;
  std::uint64_t most_calls = 0;     ///< rows that the map may be asked for; 0: any number
  std::function<void()> told = {};  ///< is called after every step, one call at a time; may throw to stop
};

/// Holds the logarithm of the chance that a walk fails within a window, interpolated between the nodes of a mesh; a
/// state off the mesh counts as the one that is least likely to fail.
struct MeshLevel {
  LevelFunction level;
  int window = 0;  ///< [steps] after which settled walks are about equally likely to fail next, 200 at most
  std::size_t nodes = 0;
  std::uint64_t calls = 0;  ///< rows that the map was asked for
};

/// Grows one coarse mesh around the gait or walk of the start, as mesh_study() would, and no other gait. It is only a
/// guide: what an ensemble finds does not hang on it, how surely does. Cost: some twenty steps of the map a node where
/// a step draws one noise; several stand on a lattice of scores, of which every place counts: some 250 a node for two,
/// 10000 and more for four.
/// @throws TooManyDimensions above most_mesh_dimensions; NoOrbit, NoFailureFound and MapError as mesh_study();
/// std::length_error where it would take more memory than allowed; NoSplitting where it would take more than
/// most_calls; std::invalid_argument for options out of range
MeshLevel mesh_level(const BatchMap& map, std::span<const double> start, const MeshLevelOptions& options = {});

}  // namespace metastable::markov
