#include "analysis/minimize.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

namespace metastable::analysis {

Minimum nelder_mead(const std::function<double(const std::vector<double>&)>& function, std::vector<double> start,
                    const std::vector<double>& step, double tolerance, int most) {
  const std::size_t n = start.size();
  struct Corner {
    std::vector<double> at;
    double value;
  };
  Minimum result;
  const auto corner = [&](std::vector<double> at) {
    ++result.evaluations;
    const double value = function(at);
    return Corner{std::move(at), value};
  };
  std::vector<Corner> simplex{corner(start)};
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> at = start;
    at[i] += step[i];
    simplex.push_back(corner(std::move(at)));
  }
  const auto lower = [](const Corner& a, const Corner& b) { return a.value < b.value; };
  for (;;) {
    std::stable_sort(simplex.begin(), simplex.end(), lower);
    result.converged = simplex.back().value - simplex.front().value < tolerance;
    if (result.converged || result.evaluations >= most) break;
    std::vector<double> centre(n, 0);
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t i = 0; i < n; ++i) centre[i] += simplex[c].at[i] / static_cast<double>(n);
    const Corner worst = simplex.back();
    const auto along = [&](double t) {  // from the worst corner through the centre of the others
      std::vector<double> at(n);
      for (std::size_t i = 0; i < n; ++i) at[i] = centre[i] + t * (centre[i] - worst.at[i]);
      return corner(std::move(at));
    };
    Corner next = along(1);
    if (next.value < simplex.front().value) {
      Corner further = along(2);
      simplex.back() = further.value < next.value ? std::move(further) : std::move(next);
      continue;
    }
    if (next.value < simplex[n - 1].value) {
      simplex.back() = std::move(next);
      continue;
    }
    Corner inside = next.value < worst.value ? along(0.5) : along(-0.5);
    if (inside.value < std::min(next.value, worst.value)) {
      simplex.back() = std::move(inside);
      continue;
    }
    for (std::size_t c = 1; c <= n; ++c) {
      std::vector<double> at(n);
      for (std::size_t i = 0; i < n; ++i) at[i] = (simplex[0].at[i] + simplex[c].at[i]) / 2;
      simplex[c] = corner(std::move(at));
    }
  }
  result.at = simplex.front().at;
  result.value = simplex.front().value;
  return result;
}

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
