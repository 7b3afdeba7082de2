#include "analysis/statistics/minimize.h"

#include <Eigen/Core>
#include <cmath>

namespace metastable::analysis {

Minimum quasi_newton(const SmoothFunction& function, const std::vector<double>& start, double tolerance, int most) {
  constexpr double longest = 3;  // step: the gradient knows nothing of what is further off
  const auto n = static_cast<Eigen::Index>(start.size());
  Minimum result;
  const auto evaluate = [&](const Eigen::VectorXd& x, Eigen::VectorXd& gradient) {
    ++result.evaluations;
    std::vector<double> slope(start.size());
    const double value = function({x.data(), x.data() + n}, slope);
    gradient = Eigen::Map<const Eigen::VectorXd>(slope.data(), n);
    return value;
  };
  Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(start.data(), n), g, next_g;
  double value = evaluate(x, g);
  if (!std::isfinite(value)) {
    result.at = start;
    result.value = value;
    return result;
  }
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(n, n);
  bool fresh = true;  // `inverse` is the start's
  while (result.evaluations < most) {
    Eigen::VectorXd step = -(inverse * g);
    if (-step.dot(g) / 2 < tolerance) {
      result.converged = true;
      break;
    }
    if (step.norm() > longest) step *= longest / step.norm();
    double t = 1, next = evaluate(x + step, next_g);
    for (int halving = 0; halving < 12 && !(next <= value + 1e-4 * t * g.dot(step)); ++halving)
      next = evaluate(x + (t /= 2) * step, next_g);
    if (!(next < value)) {
      if (fresh) break;
      inverse.setIdentity();
      fresh = true;
      continue;
    }
    const Eigen::VectorXd moved = t * step, change = next_g - g;
    x += moved;
    value = next;
    g = next_g;
    const double curvature = moved.dot(change);
    if (!(curvature > 1e-10)) continue;
    const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(n, n) - moved * change.transpose() / curvature;
    inverse = (left * inverse * left.transpose() + moved * moved.transpose() / curvature).eval();
    fresh = false;
  }
  result.at.assign(x.data(), x.data() + n);
  result.value = value;
  return result;
}

}  // namespace metastable::analysis
