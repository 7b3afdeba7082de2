#include "markov/dense_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

namespace metastable::markov {
namespace {

TEST(DenseMatrix, SpectralRadiusOfRealComplexAndDefectiveEigenvalues) {
  const Eigen::MatrixXd real{{0.5, 3}, {0, -0.8}}, turn{{0.6, -0.5}, {0.5, 0.6}}, defective{{0.7, 1}, {0, 0.7}};
  EXPECT_NEAR(spectral_radius(real), 0.8, 1e-9);
  EXPECT_NEAR(spectral_radius(turn), std::hypot(0.6, 0.5), 1e-9);
  EXPECT_NEAR(spectral_radius(defective), 0.7, 1e-9);
  EXPECT_EQ(spectral_radius(Eigen::MatrixXd{{0, 1}, {0, 0}}), 0);
}

TEST(DenseMatrix, SolvesAndTakesApart) {
  const Eigen::MatrixXd matrix{{4, 1, 0}, {1, 3, -1}, {0, -1, 2}};
  const Eigen::VectorXd right{{1, 2, 3}};
  EXPECT_LT((matrix * solve_symmetric(matrix, right) - right).norm(), 1e-14);
  EXPECT_LT((matrix * solve_columns(matrix, matrix * matrix) - matrix * matrix).norm(), 1e-13);
  EXPECT_LT((matrix * inverse_of(matrix) - Eigen::MatrixXd::Identity(3, 3)).norm(), 1e-14);
  const SymmetricEigen eigen = symmetric_eigen(matrix);
  EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - matrix).norm(), 1e-13);
  EXPECT_LT(eigen.values[0], eigen.values[2]);
}

}  // namespace
}  // namespace metastable::markov
