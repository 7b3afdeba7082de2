#pragma once
// Looks for other gaits that a walker can slip into, and how far a mesh must grow to hold the ways between them.

#include <span>
#include <string>
#include <vector>

#include "markov/mesh/mesh.h"

namespace metastable::markov {

/// The states of phase 0 that a gait comes through without noise, in order.
using GaitOrbit = std::vector<std::vector<double>>;

/// Holds the noise-free orbits that the noise can lead to within an action of 60.
struct OtherGaits {
  std::vector<GaitOrbit> orbits = {};    ///< the start's own first; alone: there is no other
  std::vector<MeshSource> sources = {};  ///< for MeshOptions: of all but the start's own
  double start_action = 0, limit = 0;    ///< for MeshOptions; limit 0: there is no other gait
  /// Empty, or a sentence that names a gait that can be slipped into and from which neither a failure nor another gait
  /// is found.
  std::string trap = {};
};

/// Returns the options of a mesh that holds all gaits; of one alone, as they are.
MeshOptions with_gaits(MeshOptions options, const OtherGaits& gaits);

/// Follows, without noise, states of a mesh and states that walks under two and four times the noise come through,
/// until they fail, are within one sd of the start's orbit, or have gone 2300 revolutions: those are on other gaits.
/// From each gait a coarse mesh is then grown until it meets the others and a failure, to an action of 60 at most. A
/// mesh of several gaits grows from each of them as far as its last exit and `options.margin`: sources start with the
/// action by which theirs is less than the farthest.
/// @param own  orbit of the start's gait  @param mesh  grown with `options`
/// @throws as Mesh does, but for NoFailureFound; MapError where there are more than eight other gaits
OtherGaits find_other_gaits(const BatchMap& map, const std::vector<NoiseFrame>& frames, const GaitOrbit& own,
                            std::span<const double> start, const Mesh& mesh, const MeshOptions& options);

}  // namespace metastable::markov
