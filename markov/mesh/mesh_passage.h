#pragma once
// Reads what a mesh says of failure, by products of its rows with distributions alone: nothing small is subtracted.

#include <functional>
#include <span>
#include <vector>

#include "markov/mesh/mesh.h"

namespace metastable::markov {

struct MeshPassage {
  /// Expected steps before failure from the start, the failing one included. Walkers that leave the mesh count as if
  /// they went on like the others; where they are likelier to fail than those, the number is too large.
  double steps = 0;
  double steps_lower = 0;            ///< if what leaves the mesh failed at once
  double failure_rate = 0;           ///< a step, once settled: distribution . kill (for phases: of the mean step)
  double mixing_steps = 0;           ///< e-folding of the distance from the quasi-stationary distribution
  std::vector<double> survival;      ///< survival[k]: share that survives step k + 1, until settled; then geometric
  std::vector<double> distribution;  ///< quasi-stationary, of one phase each summing to one
  std::vector<double> visits;        ///< expected steps that begin in each node, from the start to failure
  int products = 0;
  bool settled = true;  ///< survivors keep their form; else they were followed no further (`or_stop`)
};

/// Holds rows as far as a process holds them, all of a mesh or a share of it.
struct MassRows {
  int phases = 1;                                                                  ///< steps of a revolution
  std::span<const double> kill, leave;                                             ///< of its own nodes
  std::function<void(std::span<const double> x, std::span<double> y)> apply_left;  ///< y = x Q
  std::function<void(std::span<double>)> add_up = {};  ///< over all who share the rows; empty: there are no others
};

/// Follows the distribution of survivors, from one over the nodes of phase 0 (`start`, own nodes), until it keeps its
/// form: until the failures of a revolution will change by no more than `still_to_come` of themselves, as they fall,
/// three times running. Survivors that do not within `most_products` are an error, or are followed no further if
/// `or_stop`: they then fail on as they last did.
/// @throws ConvergenceError in the first case
MeshPassage follow_survivors(const MassRows& rows, std::vector<double> start, double still_to_come = 1e-6,
                             int most_products = 20000, bool or_stop = false);

/// Does the same from a state at phase 0 of one mesh.
/// @param revolutions  of the mesh that count as one, as where survivors come back in turns only
MeshPassage mesh_passage(const Mesh& mesh, std::span<const double> start, double still_to_come = 1e-6,
                         int most_products = 20000, bool or_stop = false, int revolutions = 1);

/// Returns u[n][i], n = 0 .. window: the probability that a walker at node i fails in exactly its (n+1)-th step.
std::vector<std::vector<double>> failure_in_step(const Mesh& mesh, int window);

}  // namespace metastable::markov
