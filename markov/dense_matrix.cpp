#include "markov/dense_matrix.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace metastable::markov {

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  return matrix.ldlt().solve(right);
}

Eigen::MatrixXd solve_columns(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() == 0) return {};  // Eigen's solver reads its first entry.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::MatrixXd symmetric_root(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd unit = matrix.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd inverse = unit.unaryExpr([](double one) { return one > 0 ? 1 / one : 0; });
  const SymmetricEigen split = symmetric_eigen(inverse.asDiagonal() * matrix * inverse.asDiagonal());
  return unit.asDiagonal() * split.vectors * split.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

Eigen::MatrixXd resolved_root(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& whole, double least_share) {
  if (!matrix.allFinite() || !whole.allFinite()) return Eigen::MatrixXd::Constant(whole.size(), whole.size(), NAN);
  const Eigen::VectorXd unit =
      whole.unaryExpr([](double information) { return information > 0 ? 1 / std::sqrt(information) : 0; });
  const SymmetricEigen split = symmetric_eigen(unit.asDiagonal() * matrix * unit.asDiagonal());
  const Eigen::Index resolved = (split.values.array() > least_share).count();  // the last ones
  return unit.asDiagonal() * split.vectors.rightCols(resolved) *
         split.values.tail(resolved).cwiseSqrt().cwiseInverse().asDiagonal();
}

Eigen::MatrixXd floored_inverse(const Eigen::MatrixXd& matrix, double least_share) {
  constexpr double unknown = 1e6;  // unit of what has no information at all, so that it has an inverse
  const Eigen::VectorXd unit = matrix.diagonal().unaryExpr(
      [](double information) { return information > 0 ? 1 / std::sqrt(information) : unknown; });
  const SymmetricEigen split = symmetric_eigen(unit.asDiagonal() * matrix * unit.asDiagonal());
  const Eigen::MatrixXd root = unit.asDiagonal() * split.vectors;
  return root * split.values.cwiseMax(least_share).cwiseInverse().asDiagonal() * root.transpose();
}

std::vector<std::complex<double>> eigenvalues_of(const Eigen::MatrixXd& matrix) {
  const Eigen::VectorXcd values = matrix.eigenvalues();
  std::vector<std::complex<double>> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
    return std::abs(a) != std::abs(b) ? std::abs(a) > std::abs(b) : a.imag() > b.imag();
  });
  return sorted;
}

double spectral_radius(Eigen::MatrixXd matrix) {
  double log_radius = 0, power = 1;
  for (int squaring = 0; squaring < 40; ++squaring, power *= 2) {
    const double size = matrix.norm();
    if (!(size > 0)) return 0;
    log_radius += std::log(size) / power;
    matrix /= size;
    matrix *= matrix;
  }
  return std::exp(log_radius);
}

Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix) { return matrix.inverse(); }

}  // namespace metastable::markov
