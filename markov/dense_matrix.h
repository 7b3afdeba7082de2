#pragma once
// Factorises small dense matrices. Eigen's decompositions are instantiated in the source of this header alone: each
// costs whoever else instantiates it up to ten seconds of compiling.

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace metastable::markov {

/// Solves systems with one symmetric matrix by its LDL^T factors. Semidefinite ones give some solution.
/// @param matrix  [n x n], of which the lower triangle is read
/// @param right  [n]
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
/// Does it for every column of `right` [n x k].
Eigen::MatrixXd solve_columns(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// Holds the eigenvalues [n] of a symmetric matrix by rising size, and its orthonormal eigenvectors [n x n] by column.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
/// @param matrix  [n x n], n >= 1, of which the lower triangle is read
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);

/// Returns R [n x n], R R^T being the symmetric matrix, of which negative eigenvalues count as 0. Its rows may have
/// units that are far apart: it is split in units of its diagonal.
Eigen::MatrixXd symmetric_root(const Eigen::MatrixXd& matrix);

/// Returns the root R [n x r] of the pseudo-inverse R R^T of a symmetric semidefinite matrix, over the r directions of
/// which more is left than a share: eigenvectors of the matrix in units of `whole` whose eigenvalue is above it. What
/// else there is, rounding or the errors of differences, counts as nothing.
/// @param matrix  [n x n], n >= 1, of which the lower triangle is read; where it is not finite neither is R
/// @param whole  [n] its diagonal before anything was projected out; where that is not positive nothing is resolved
/// @param least_share  in (0, 1)
Eigen::MatrixXd resolved_root(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& whole, double least_share);

/// Returns the inverse of a symmetric semidefinite matrix, whose eigenvalues in units of its diagonal are taken to be
/// no less than a share: along what is lost it is large instead of whatever rounding makes of it.
/// @param matrix  [n x n], n >= 1, of which the lower triangle is read  @param least_share  in (0, 1)
Eigen::MatrixXd floored_inverse(const Eigen::MatrixXd& matrix, double least_share);

/// Returns the modulus of the largest eigenvalue, real or complex, of a matrix [n x n], n >= 1, to nine digits: by
/// repeated squaring (Gelfand's formula).
double spectral_radius(Eigen::MatrixXd matrix);

/// Returns the eigenvalues of a matrix [n x n], n >= 1, by falling modulus; of a conjugate pair the upper one first.
std::vector<std::complex<double>> eigenvalues_of(const Eigen::MatrixXd& matrix);

/// Returns the inverse of an invertible matrix [n x n].
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix);

}  // namespace metastable::markov
