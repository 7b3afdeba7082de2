#pragma once
// Finds where a curve that is known with an interval crosses zero.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// The curve at one place: lower <= value <= upper; ends may be infinite.
struct CurvePoint {
  double at = 0;
  Estimate height;
  std::string unknown;  ///< why there is no height, empty where there is one
};

/// A place where the curve crosses zero.
struct Crossing {
  Estimate at;         ///< with the places between which the curve's interval holds zero
  bool rising = true;  ///< from below zero to above
  bool open_below = false,
       open_above = false;  ///< the interval holds zero as far as the range goes, and perhaps beyond
};

struct CrossingOptions {
  std::size_t points = 17;   ///< looked at first, ends included, >= 3
  bool logarithmic = false;  ///< spaced evenly in the logarithm of the place, else in the place; from > 0 then
  int threads = 0;           ///< of the points looked at first, side by side; 0: all cores
  /// A listener that is told how many places have been looked at; it may throw to stop. One call at a time.
  std::function<void(std::size_t)> progress = {};
};

struct Crossings {
  std::vector<CurvePoint> scanned;  ///< the points looked at first
  std::vector<Crossing> crossings;  ///< rising places
};

/// The curve's height at a place. @param threads  it may use. The bits must not depend on them.
/// Where the point is unknown it says why; it may throw to stop all.
using Curve = std::function<CurvePoint(double at, int threads)>;

/// Looks at evenly spaced points, and between neighbours of different sign for the crossing by TOMS 748 (Alefeld,
/// Potra, Shi 1995). Where the curve turns towards zero without a change of sign, up to three steps of parabolic
/// interpolation look whether it reaches it. Each end of an interval is known to a twentieth of the half of it, the
/// crossing to half of that. A curve that crosses and comes back between two points, without turning there as seen from
/// them, is missed. Cost: `points`, and about ten more a crossing.
/// @throws std::invalid_argument for from >= to, fewer than 3 points, or a range that is not above 0 where logarithmic;
/// std::runtime_error where the curve is unknown at a place between two of different sign
Crossings level_crossings(const Curve& curve, double from, double to, const CrossingOptions& options);

}  // namespace metastable::analysis
