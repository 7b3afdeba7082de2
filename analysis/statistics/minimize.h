#pragma once
// Finds the minimum of a smooth function of a few variables.

#include <functional>
#include <vector>

namespace metastable::analysis {

struct Minimum {
  std::vector<double> at;
  double value = 0;
  int evaluations = 0;
  bool converged = false;
};

/// A function with its gradient, which has the point's length.
using SmoothFunction = std::function<double(const std::vector<double>& at, std::vector<double>& gradient)>;

/// Descends by quasi-Newton steps (BFGS; Nocedal and Wright 2006, ch. 6), for variables in which the function changes
/// by about 1 over about 1. Stops when a Newton step promises less than `tolerance` (absolute), when no step along it
/// falls, or at `most` evaluations. The function may return +infinity outside its domain; where `start` is outside, its
/// value comes back, not converged.
Minimum quasi_newton(const SmoothFunction& function, const std::vector<double>& start, double tolerance, int most);

}  // namespace metastable::analysis
