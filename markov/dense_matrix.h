#pragma once
// Factorises small dense matrices. Eigen's decompositions are instantiated in the source of this header alone: each
// costs whoever else instantiates it up to ten seconds of compiling.

#include <Eigen/Core>

namespace metastable::markov {

/// Solves systems with one symmetric matrix by its LDL^T factors. Semidefinite ones give some solution.
/// @param matrix  [n x n], n >= 1, of which the lower triangle is read
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

/// Returns the modulus of the largest eigenvalue, real or complex, of a matrix [n x n], n >= 1, to nine digits: by
/// repeated squaring (Gelfand's formula).
double spectral_radius(Eigen::MatrixXd matrix);

/// Returns the inverse of an invertible matrix [n x n].
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix);

}  // namespace metastable::markov
