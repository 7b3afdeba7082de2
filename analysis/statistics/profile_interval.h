#pragma once
// Finds intervals of single variables from a likelihood of several, by its profile.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "analysis/statistics/minimize.h"

namespace metastable::analysis {

/// Ends where the profile has risen by half of chi^2's 95 % quantile with one degree of freedom (1.92). An end that it
/// does not reach is the end of the range, and not bounded.
struct ProfileInterval {
  double lower = 0, upper = 0;
  bool bounded_below = false, bounded_above = false;
  /// A point below the minimum given, should the others have found one: the interval then does not hold.
  std::optional<Minimum> better = {};
};

/// Says where to start a descent from a guess, along each of contour_axes(): the guess itself may be a saddle, where a
/// variable counts by its square and is 0.
constexpr double off_the_guess = 0.3;

/// Gives the variables' scales and dependences near a minimum: columns span the contours of the Hessian, none longer
/// than 0.05.
Eigen::MatrixXd contour_axes(const Eigen::MatrixXd& hessian);

/// Holds a local minimum and the Hessian there, finite.
struct Mode {
  Minimum minimum;
  Eigen::MatrixXd hessian;
};

/// Follows the profile of `cost` (minus ln likelihood) in each variable: the others at their best for each of its
/// values, followed from each mode outwards (quasi_newton), and from points that profiles before went through: where
/// there are several branches, the lowest of those found. The interval spans those of all modes. Right to 0.02 of the
/// half-width where ends are found. Stops at the first better minimum.
/// @param modes     the lowest first
/// @param low,high  ranges of the variables; the cost may be infinite beyond
/// Cost: some 50 evaluations a variable and mode
std::vector<ProfileInterval> profile_intervals(const SmoothFunction& cost, const std::vector<Mode>& modes,
                                               const std::vector<double>& low, const std::vector<double>& high);

}  // namespace metastable::analysis
