#include "analysis/motion_capture/savitzky_golay.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "markov/dense_matrix.h"

namespace metastable::analysis {

SavitzkyGolay::SavitzkyGolay(int window, int degree, int derivative) : window_(window), derivative_(derivative) {
  if (degree < 0 || degree > 6) throw std::invalid_argument(fmt::format("degree: {} is outside 0..6", degree));
  if (window % 2 == 0 || window <= degree || window > 10001)
    throw std::invalid_argument(
        fmt::format("window: {} is not an odd number of samples in {}..10001", window, degree + 1));
  if (derivative < 0 || derivative > degree)
    throw std::invalid_argument(fmt::format("derivative: {} is outside 0..{}", derivative, degree));
  // Positions are scaled to [-1, 1], so that the powers stay of one size.
  const double half = std::max(1, window / 2);
  const auto position = [&](int i) { return (i - window / 2) / half; };
  Eigen::MatrixXd powers(window, degree + 1);
  for (int i = 0; i < window; ++i)
    for (int p = 0; p <= degree; ++p) powers(i, p) = std::pow(position(i), p);
  // On [-1, 1] and at these degrees normal equations lose no more than a few digits.
  const Eigen::MatrixXd fit =
      markov::solve_columns(powers.transpose() * powers, powers.transpose());  // samples to coefficients
  weights_.resize(static_cast<std::size_t>(window) * static_cast<std::size_t>(window));
  for (int at = 0; at < window; ++at) {
    Eigen::RowVectorXd value = Eigen::RowVectorXd::Zero(degree + 1);
    for (int p = derivative; p <= degree; ++p) {
      double factor = std::pow(position(at), p - derivative) / std::pow(half, derivative);
      for (int k = 0; k < derivative; ++k) factor *= p - k;
      value(p) = factor;
    }
    Eigen::Map<Eigen::RowVectorXd>(weights_.data() + static_cast<std::ptrdiff_t>(at) * window, window) = value * fit;
  }
}

std::span<const double> SavitzkyGolay::weights(int at) const {
  return std::span(weights_).subspan(static_cast<std::size_t>(at) * static_cast<std::size_t>(window_),
                                     static_cast<std::size_t>(window_));
}

std::vector<double> SavitzkyGolay::apply(std::span<const double> values, double spacing) const {
  const auto window = static_cast<std::size_t>(window_), half = window / 2;
  if (values.size() < window)
    throw std::invalid_argument(fmt::format("{} samples are fewer than the window of {}", values.size(), window_));
  const double scale = std::pow(spacing, -derivative_);
  std::vector<double> out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t first = std::clamp(i, half, values.size() - 1 - half) - half;
    const std::span<const double> row = weights(static_cast<int>(i - first));
    double sum = 0;
    for (std::size_t k = 0; k < window; ++k) sum += row[k] * values[first + k];
    out[i] = scale * sum;
  }
  return out;
}

}  // namespace metastable::analysis
