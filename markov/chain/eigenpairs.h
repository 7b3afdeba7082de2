#pragma once
// Finds leading eigenvalues of the transient block with Spectra (Arnoldi, shift-invert).

#include <complex>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

struct Eigenpairs {
  std::vector<std::complex<double>> values;  ///< by falling modulus; values[0] is lambda_1
  std::vector<double> left;                  ///< left eigenvector of lambda_1, >= 0, sum 1
  double residual = 0;                       ///< max |left Q - lambda_1 left|
};

/// Finds the `count` eigenvalues of Q nearest to the shift, by falling modulus, and lambda_1's left eigenvector.
///
/// Shift-invert at sigma = 1.05 (just outside the spectrum, so that lambda_2 is resolved even when
/// 1 - lambda_1 is below rounding), solves by KLU. lambda_1 has an absolute error near 1e-15: its distance
/// to one must come from quasi_stationary(). It is meant for aperiodic chains (for cyclic ones: the revolution
/// chain). Chains of fewer than 16 states, or of fewer than count + 2, are solved densely with Eigen, O(n^3).
/// @param count number of eigenvalues wanted, >= 1; fewer are returned when the chain is smaller, and one more when
///        the last would be half of a conjugate pair
/// @throws ConvergenceError("Spectra", residual, ...) when info() is not Successful or the residual exceeds 1e-8;
///         std::invalid_argument when count < 1 or the chain has no states.
Eigenpairs leading_eigenpairs(const Chain& chain, int count);

}  // namespace metastable::markov
