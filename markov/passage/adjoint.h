#pragma once
// Says how the expected steps respond to small changes of a chain.

#include <cstddef>
#include <vector>

#include "markov/chain/solver.h"
#include "markov/passage/first_passage.h"

namespace metastable::markov {

/// Holds what a first-order change of the expected steps M from a launch is made of: with m = (I - Q)^-1 1 and the row
/// vector y = l (I - Q)^-1 of expected visits, dM = y dQ m + dl m.
struct Adjoint {
  double steps = 0;            ///< M, the launch's own step counted
  std::vector<double> mean;    ///< m [steps], size n
  std::vector<double> visits;  ///< y, size n
  std::size_t reference = 0;   ///< the state visited most
  /// Holds m_i - m_reference [steps], as (time to the reference or rest) - P(rest before the reference) m_reference:
  /// where rest is rare the differences are far smaller than the means and would be lost to their rounding.
  std::vector<double> excess;
};

/// Costs two solves on the chain, and an elimination with two solves on the chain without its reference.
/// @throws as ChainSolver
Adjoint adjoint(const ChainSolver& solver, const Launch& launch);

/// Returns y (Q_to - Q_from) m + (l_to - l_from) m [steps] for two chains (and launches) near that of `at`; row sums of
/// the changes come from the kill rates. The diagonals, which are not stored, drop out. O(entries).
/// @throws std::invalid_argument for chains of other sizes
double steps_change(const Adjoint& at, const Chain& from, const Launch& launch_from, const Chain& to,
                    const Launch& launch_to);

}  // namespace metastable::markov
