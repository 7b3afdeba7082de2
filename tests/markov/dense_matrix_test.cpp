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

// A matrix of full rank is inverted; of 2 u u^T only u is left: the rounding of a singular matrix is not inverted.
TEST(DenseMatrix, ResolvedRootLeavesOutWhatIsLost) {
  const Eigen::VectorXd u{{0.6, 0.8}}, v{{0.8, -0.6}};
  const Eigen::MatrixXd whole_rank = 2 * u * u.transpose() + 0.02 * v * v.transpose();
  const Eigen::VectorXd two = Eigen::VectorXd::Constant(2, 2);
  const Eigen::MatrixXd full = resolved_root(whole_rank, two, 1e-3);
  EXPECT_LT((full * full.transpose() - inverse_of(whole_rank)).norm(), 1e-11);
  for (const double rounding : {1e-16, -1e-16, 0.0}) {
    const Eigen::MatrixXd root = resolved_root(2 * u * u.transpose() + rounding * v * v.transpose(), two, 1e-6);
    ASSERT_EQ(root.cols(), 1);
    EXPECT_LT((root * root.transpose() - 0.5 * u * u.transpose()).norm(), 1e-14);
  }
  EXPECT_EQ(resolved_root(Eigen::MatrixXd::Identity(2, 2), Eigen::VectorXd::Zero(2), 1e-6).cols(), 0);
  EXPECT_TRUE(resolved_root(Eigen::MatrixXd::Constant(2, 2, NAN), two, 1e-6).array().isNaN().all());
}

// A lost direction has the variance of the floor, a resolved one its own; no information at all is no division by zero.
TEST(DenseMatrix, FlooredInverseIsLargeAlongWhatIsLost) {
  const Eigen::MatrixXd matrix{{4, 1, 0}, {1, 3, -1}, {0, -1, 2}};
  EXPECT_LT((floored_inverse(matrix, 1e-6) - inverse_of(matrix)).norm(), 1e-13);
  for (const double rounding : {1e-16, -1e-16, 0.0}) {
    const Eigen::MatrixXd inverse =
        floored_inverse(Eigen::MatrixXd::Ones(2, 2) + rounding * Eigen::MatrixXd::Identity(2, 2), 1e-6);
    EXPECT_NEAR(inverse(0, 0), 0.5e6, 1);
    EXPECT_NEAR(Eigen::VectorXd::Ones(2).dot(inverse * Eigen::VectorXd::Ones(2)), 1, 1e-9);
  }
  EXPECT_NEAR(floored_inverse(Eigen::MatrixXd::Zero(1, 1), 1e-6)(0, 0), 1e18, 1e9);
}

}  // namespace
}  // namespace metastable::markov
