#pragma once
// Finds what a mesh across ranks says of failure, by SLEPc's eigenvectors and PETSc's linear solver.

#include <vector>

#include "markov/ranks/shared_mesh.h"

namespace metastable::markov {

/// What leaves the mesh counts as failed.
struct SharedPassage {
  double failure_rate = 0;  ///< a step: quasi-stationary distribution . (kill + leave); for phases as QuasiStationary's
  double steps = 0;         ///< expected steps from the mesh's start, the failing one included
  std::vector<double> distribution;  ///< quasi-stationary, own nodes; of one phase each summing to one over all ranks
  std::vector<double> survival_weight;  ///< right eigenvector, own nodes; distribution . weight is 1 in every phase
  std::vector<double> expected_steps;   ///< from each own node
  int eigen_iterations = 0;             ///< restarts of SLEPc's Krylov-Schur, left and right
  int products = 0;                     ///< by which both vectors were then made exact in every entry
  int linear_iterations = 0;            ///< of PETSc's GMRES, over all refinements
  double residual = 0;  ///< largest |1 + Q m - m|, where the large part of m = c w + u drops out exactly
};

/// Solves pi Q = lambda pi, Q w = lambda w and (I - Q) m = 1.
///
/// Nothing small is left to a subtraction. SLEPc's vectors are right to rounding of their largest entries, which says
/// nothing of the rare states that failures come from: products with the rows, all of whose terms are positive, follow
/// until the rate pi . kill and every entry of w stand still to 1e-13. I - Q is as near to singular as failures are
/// rare, so it is never solved as it is: m = c w + u with c = (pi . 1) / (rate (pi . w)), and u, which is of the order
/// of the mixing time, solves (I - Q) u = 1 - rate c w on the complement of pi, whose condition has nothing to do with
/// how rare failures are. Relative errors are a small multiple of mixing time times rounding: held against elimination
/// out to 5e11 steps.
/// @throws ConvergenceError if SLEPc or PETSc do not converge, or 20000 products do not settle
SharedPassage shared_passage(const SharedMesh& mesh);

}  // namespace metastable::markov
