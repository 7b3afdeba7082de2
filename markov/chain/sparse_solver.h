#pragma once
// Solves sparse systems directly with SuiteSparse's KLU (LGPL; chosen over UMFPACK and SPQR, which are GPL).

#include <memory>
#include <span>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// Factorizes sigma I - Q as LU. At sigma = 1 it loses digits as rest becomes rare (about
/// eps / (1 - lambda_1)): it is an independent check, never the primary answer.
class SparseSolver {
 public:
  /// @param sigma  the shift [1]; 1 gives I - Q
  /// @throws ConvergenceError("KLU", ...) if the matrix is numerically singular (KLU's status, or its cheap estimate of
  ///         the reciprocal condition is below 2.2e-16); std::invalid_argument for a chain without states.
  explicit SparseSolver(const Chain& chain, double sigma = 1.0);
  ~SparseSolver();
  SparseSolver(SparseSolver&&) noexcept;
  SparseSolver& operator=(SparseSolver&&) noexcept;

  /// Solves (sigma I - Q) x = rhs. @param rhs size n, any signs (otherwise std::invalid_argument).
  /// Not safe to call from two threads at once: KLU works in the factors.
  /// @throws ConvergenceError("KLU", ...) if the solution is not finite.
  std::vector<double> solve(std::span<const double> rhs) const;
  /// Solves y (sigma I - Q) = rhs (row vectors) on the same conditions.
  std::vector<double> solve_left(std::span<const double> rhs) const;

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace metastable::markov
