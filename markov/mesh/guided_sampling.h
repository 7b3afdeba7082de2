#pragma once
// Finds the failure rate by importance sampling that a mesh guides: unbiased however coarse the mesh is.

#include <cstdint>
#include <span>

#include "markov/mesh/batch_map.h"
#include "markov/mesh/mesh.h"

namespace metastable::markov {

struct GuidedOptions {
  std::size_t samples = 2000;  ///< >= 16
  int burn_in = 60;            ///< steps of direct simulation from the start before each sample
  /// Counts the steps over which a sample is led to failure, >= 1, and well below the expected steps: where more than a
  /// third fail within it, the rate that comes out is too low.
  int window = 12;
  std::uint64_t seed = 1;
  double score_spacing = 0.6, score_reach = 8.5;
  int threads = 0;  ///< 0: all cores; the bits do not depend on it
};

struct GuidedRate {
  double rate = 0, standard_error = 0;  ///< probability of failing in a step, of walkers that walked on so far
  std::size_t samples = 0;
  double effective_samples = 0;  ///< (sum w)^2 / sum w^2
};

/// A sample is a walker after `burn_in` steps from `start`, or of a later attempt if that one failed. In each of the
/// next `window` steps it is offered a randomly moved lattice of scores, takes one with probability in proportion to
/// weight times (the mesh's probability of failing in exactly the step asked for, plus a share of its mean), and
/// carries the ratio as its weight; in the step after, the probability of failing is summed over the lattice. The mean
/// weight is the failure rate times the share that walks on for so long.
/// Samples take turns at the phases; windows are lengthened to whole revolutions. Of a gait of several revolutions the
/// map may be watched over all of them (over_revolutions), the mesh over one.
/// @throws as checked_step does; std::invalid_argument for options out of range
GuidedRate guided_failure_rate(const BatchMap& map, const Mesh& mesh, std::span<const double> start,
                               const GuidedOptions& options);

/// Returns the least window, 1 to `most`, after which the mesh foretells failure in the step that follows about equally
/// likely (to a fifth, as a root of mean squares) from wherever settled survivors are: their weights will be even.
/// `most` where there is none.
/// @param settled  MeshPassage::distribution; empty: not known
int reaching_window(const Mesh& mesh, std::span<const double> settled, int most);

/// Returns the score_reach that samples need to find such a failure rate, at most the default one: scores beyond are so
/// few that they bear on no rate as large as this one, nor on a larger one, and hardly on one ten times smaller.
/// @param scores  >= 1  @param window  >= 1  @param rate  a step, > 0
double sampled_reach(int scores, int window, double rate);

}  // namespace metastable::markov
