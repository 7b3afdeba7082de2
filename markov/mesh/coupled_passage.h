#pragma once
// Finds expected steps on a mesh whose chain falls into classes that are hardly ever left: several gaits.

#include <cstdint>
#include <span>
#include <vector>

#include "markov/mesh/mesh_passage.h"

namespace metastable::markov {

/// Assigns every node to one of the states `gaits` (of phase 0): the nearest, in units of the phase's principal axes,
/// to where the likeliest steps lead it. The classes need not be exact: they only make coupled_passage() converge fast.
std::vector<std::uint32_t> gait_classes(const Mesh& mesh, const std::vector<std::vector<double>>& gaits,
                                        std::span<const NoiseFrame> frames);

/// Does what mesh_passage() does where its survivors would change for as long as it takes to slip from one gait to
/// another. The expected visits y = b + y Q are found by aggregation and disaggregation: in turns, the classes (by
/// phase) are solved as one small chain, whose entries are sums of positive terms and which is eliminated without a
/// subtraction (ChainSolver), and y is smoothed by products. What is left falls in a round as the classes mix within
/// themselves, however seldom they are left (Koury, McAllister, Stewart 1984; Takahashi 1975).
///
/// Failure rate: of those that have walked on for ever. Survival and mixing: those of mesh_passage until survivors keep
/// the form they have in the first gait, or over 4000 steps where they do not. `first_rate` is the chance of failing in
/// a step after that.
/// @param gait  of each node, below `gaits`
/// @throws ConvergenceError if visits, or then the rate, still change after 20000 products; std::domain_error where
/// some class never fails
struct CoupledPassage {
  MeshPassage passage;
  double first_rate = 0;
  std::vector<double> share = {};  ///< of the expected steps that are taken in each gait
};
CoupledPassage coupled_passage(const Mesh& mesh, std::span<const double> start, const std::vector<std::uint32_t>& gait,
                               std::size_t gaits);

}  // namespace metastable::markov
