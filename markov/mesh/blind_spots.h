#pragma once
// Probes a map at random where a mesh did not step it: for failures that the mesh steps over.

#include <cstdint>
#include <span>
#include <vector>

#include "markov/mesh/mesh.h"

namespace metastable::markov {

struct BlindSpots {
  std::size_t probes = 0;  ///< steps at random places
  std::size_t hits = 0;    ///< of them that fail where the mesh foretells none, or the other way round
  /// Bound (estimate and two standard errors) the expected number, in a walk from the start to the mesh's failure, of
  /// failures that the mesh does not see, and of survivals that it takes for failures: 0.1 is a tenth of the rate.
  double missed = 0, imagined = 0;
};

/// From 3000 random states between the nodes (half of them spread evenly over the nodes, however rarely they are
/// visited, the others where walkers are and where they fail) it follows a curve in the first score as a mesh does, and
/// steps 16 scores spread evenly along it, the others drawn with twice the noise. A failure between two places that
/// land is missed; so is one of a whole line in a cell whose nodes hardly fail. Every one counts with its probability:
/// what matters to the answer is found wherever it lies, if it is about 1e-3 sd wide or more, also where simulation
/// would meet it in 1e9 steps.
/// @param visits  of each node from the start to failure (MeshPassage::visits)
/// @param options  the mesh's
BlindSpots find_blind_spots(const BatchMap& map, const std::vector<NoiseFrame>& frames, const Mesh& mesh,
                            std::span<const double> visits, const MeshOptions& options);

/// Returns whether the chance of failing jumps between nodes that are neighbours by so much that it matters, as where a
/// failure is told by the state before the step: of the pairs whose difference is worth a share of the rate, the
/// largest first, it halves the edge, and again the half that differs more, seven times. A smooth chance differs by
/// about 1/128 then.
/// @param visits, options  as above
bool failing_jumps(const BatchMap& map, const std::vector<NoiseFrame>& frames, const Mesh& mesh,
                   std::span<const double> visits, const MeshOptions& options);

}  // namespace metastable::markov
