#include "markov/chain/eigenpairs.h"

// GCC 12 takes a vector that Spectra resizes in a loop for one that is used after it was freed.
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 12
#pragma GCC diagnostic ignored "-Wuse-after-free"
#endif
#include <Spectra/GenEigsRealShiftSolver.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "markov/chain/solver.h"
#include "markov/chain/sparse_solver.h"

namespace metastable::markov {
namespace {

using Complex = std::complex<double>;

constexpr double shift = 1.05;
constexpr double tolerance = 1e-13;
constexpr double worst_residual = 1e-8;
constexpr double same_value = 1e-10;
constexpr int dense_size = 16;
constexpr int iteration_limit = 2000;

struct RawPairs {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
};

/// Applies x -> (Q^T - sigma I)^{-1} x, the operator Spectra iterates with: its eigenvectors are Q's left ones.
class TransposedShiftInvert {
 public:
  using Scalar = double;
  explicit TransposedShiftInvert(const Chain& chain) : size_(chain.size()), solver_(chain, shift) {}
  Eigen::Index rows() const { return static_cast<Eigen::Index>(size_); }
  Eigen::Index cols() const { return rows(); }
  void set_shift(double) {}  // fixed at construction
  void perform_op(const double* x, double* result) const {
    const std::vector<double> solution = solver_.solve_left({x, size_});
    std::transform(solution.begin(), solution.end(), result, std::negate<>());
  }

 private:
  std::size_t size_;
  SparseSolver solver_;
};

RawPairs dense_pairs(const Chain& chain) {
  const auto n = static_cast<Eigen::Index>(chain.size());
  Eigen::MatrixXd transposed = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    transposed(row, row) = chain.stay(i);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e) transposed(chain.columns(i)[e], row) = chain.values(i)[e];
  }
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(transposed);
  if (solver.info() != Eigen::Success) throw ConvergenceError("Spectra", 1, "the dense eigensolver failed");
  return {solver.eigenvalues(), solver.eigenvectors()};
}

RawPairs arnoldi_pairs(const Chain& chain, int count) {
  const auto n = static_cast<int>(chain.size());
  TransposedShiftInvert inverse(chain);
  int subspace = std::min(n, std::max(2 * count + 1, 24));
  for (;; subspace = std::min(n, 3 * subspace)) {
    Spectra::GenEigsRealShiftSolver<TransposedShiftInvert> solver(inverse, count, subspace, shift);
    solver.init();
    const auto converged = solver.compute(Spectra::SortRule::LargestMagn, iteration_limit, tolerance);
    if (solver.info() == Spectra::CompInfo::Successful) return {solver.eigenvalues(), solver.eigenvectors()};
    if (subspace == n || subspace >= 200) {
      throw ConvergenceError("Spectra", 1,
                             std::to_string(converged) + " of " + std::to_string(count) + " eigenvalues found");
    }
  }
}

Eigen::Index leading_index(const Eigen::VectorXcd& values) {
  Eigen::Index leading = 0;
  values.real().maxCoeff(&leading);
  return leading;
}

/// Sorts the values by falling modulus, `leading` first, of a conjugate pair the positive imaginary part. The partner
/// of a complex value is added where Spectra's count cut the pair.
std::vector<Complex> sorted_values(const Eigen::VectorXcd& values, Eigen::Index leading) {
  std::vector<Complex> others;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (i == leading) continue;
    others.push_back(values[i]);
    const Complex partner = std::conj(values[i]);
    const bool complete = (values.array() - partner).abs().minCoeff() <= same_value * std::abs(partner);
    if (partner.imag() != 0 && !complete) others.push_back(partner);
  }
  std::sort(others.begin(), others.end(), [](Complex a, Complex b) {
    const double difference = std::abs(a) - std::abs(b);
    return difference != 0 ? difference > 0 : a.imag() > b.imag();
  });
  others.insert(others.begin(), values[leading]);
  return others;
}

std::vector<double> leading_vector(const Eigen::VectorXcd& vector, bool any_sign) {
  // An eigenvector is known up to a complex factor; the leading one is real and of one sign after this.
  Eigen::Index largest = 0;
  vector.cwiseAbs().maxCoeff(&largest);
  const Complex turn = std::abs(vector[largest]) / vector[largest];
  std::vector<double> left;
  for (const Complex entry : vector)
    left.push_back(any_sign ? (entry * turn).real() : std::max(0.0, (entry * turn).real()));
  const double sum = std::accumulate(left.begin(), left.end(), 0.0);
  for (double& entry : left) entry /= sum;
  return left;
}

}  // namespace

Eigenpairs leading_eigenpairs(const Chain& chain, int count) {
  const auto n = static_cast<int>(chain.size());
  if (n == 0 || count < 1) throw std::invalid_argument("eigenpairs: at least one state and one eigenvalue expected");
  const RawPairs raw = n < dense_size || count > n - 2 ? dense_pairs(chain) : arnoldi_pairs(chain, count);
  const Eigen::Index leading = leading_index(raw.values);

  Eigenpairs pairs;
  pairs.values = sorted_values(raw.values, leading);
  const auto wanted = static_cast<std::size_t>(count);
  if (pairs.values.size() > wanted) pairs.values.resize(wanted + (pairs.values[wanted - 1].imag() > 0 ? 1 : 0));
  pairs.left = leading_vector(raw.vectors.col(leading), chain.interpolated());
  const std::vector<double> image = apply_left(chain, pairs.left);
  for (std::size_t i = 0; i < image.size(); ++i) {
    pairs.residual = std::max(pairs.residual, std::abs(image[i] - pairs.values[0].real() * pairs.left[i]));
  }
  if (!(pairs.residual <= worst_residual)) {
    throw ConvergenceError("Spectra", pairs.residual, "the left eigenvector of lambda_1 is not one");
  }
  return pairs;
}

}  // namespace metastable::markov
