#pragma once
// Finds expected steps on a mesh whose chain falls into classes that are hardly ever left: several gaits.

#include <cstdint>
#include <span>
#include <vector>

#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/other_gaits.h"

namespace metastable::markov {

/// Assigns every node of a mesh to a gait and to a place on its orbit.
struct GaitClasses {
  std::vector<std::uint32_t> of_node;  ///< class of each node
  std::vector<std::uint32_t> gait;     ///< of each class
  std::size_t gaits = 1;
  int revolutions = 1;  ///< of the first gait
};

/// A class is a place on the orbit of a gait: of the nodes there, and of those from where the likeliest steps lead into
/// its turn, to the nearest state in units of the principal axes. Classes need not be exact: they only make
/// coupled_passage() converge fast.
GaitClasses gait_classes(const Mesh& mesh, const std::vector<GaitOrbit>& gaits, std::span<const NoiseFrame> frames);

/// Does what mesh_passage() does where its survivors would change for as long as it takes to slip from one gait to
/// another, or from one turn of a gait of several revolutions to the next. The expected visits y = b + y Q are found by
/// aggregation and disaggregation: in turns, the classes (by phase) are solved as one small chain, whose entries are
/// sums of positive terms and which is eliminated without a subtraction (ChainSolver), and y is smoothed by products.
/// The error shrinks in each round by as much as the classes mix within themselves, however seldom a walker leaves them
/// (Koury, McAllister, Stewart 1984; Takahashi 1975).
///
/// Failure rate: of those that have walked on for ever. Survival and mixing: those of mesh_passage until survivors keep
/// the form they have in the first gait, or over 4000 steps where they do not. `first_rate` is the chance of failing in
/// a step after that. Of one gait whose survivors come to keep their form within those steps that is the answer.
/// @throws ConvergenceError if visits, or then the rate, still change after 20000 products; std::domain_error where
/// some class never fails
struct CoupledPassage {
  MeshPassage passage;
  double first_rate = 0;
  std::vector<double> share = {1.0};  ///< of the expected steps that are taken in each gait
};
CoupledPassage coupled_passage(const Mesh& mesh, std::span<const double> start, const GaitClasses& classes);

/// Returns the share of the failures that come from each gait: the one that a walker was within one sd of last, at
/// phase 0. Those who never were count for the first.
/// @param visits  CoupledPassage::passage's
std::vector<double> failures_by_gait(const Mesh& mesh, std::span<const double> start, std::span<const double> visits,
                                     const std::vector<GaitOrbit>& gaits, std::span<const NoiseFrame> frames);

/// Does what is needed: of one gait of one revolution mesh_passage() alone.
CoupledPassage passage_with_gaits(const Mesh& mesh, std::span<const double> start, const std::vector<GaitOrbit>& gaits,
                                  std::span<const NoiseFrame> frames);

}  // namespace metastable::markov
