#pragma once
// Minimum of a smooth function of a few variables that is only known by its values.

#include <functional>
#include <vector>

namespace metastable::analysis {

struct Minimum {
  std::vector<double> at;
  double value = 0;
  int evaluations = 0;
  bool converged = false;
};

/// Downhill simplex of Nelder and Mead (1965), with restart-free standard coefficients (1, 2, 1/2, 1/2).
/// Stops when the simplex' values differ by less than `tolerance` (absolute) or at `most` evaluations. The function may
/// return +infinity outside its domain, not at `start`.
/// @param step  size of the first simplex along each axis
Minimum nelder_mead(const std::function<double(const std::vector<double>&)>& function, std::vector<double> start,
                    const std::vector<double>& step, double tolerance, int most);

/// A function with its gradient, which has the point's length.
using SmoothFunction = std::function<double(const std::vector<double>& at, std::vector<double>& gradient)>;

/// Quasi-Newton descent (BFGS; Nocedal and Wright 2006, ch. 6), for variables in which the function changes by about 1
/// over about 1. Stops when a Newton step promises less than `tolerance` (absolute), when no step along it falls, or at
/// `most` evaluations. The function may return +infinity outside its domain, not at `start`.
Minimum quasi_newton(const SmoothFunction& function, const std::vector<double>& start, double tolerance, int most);

}  // namespace metastable::analysis
