#pragma once
// Holds a number with its interval.

#include <limits>

namespace metastable::analysis {

/// The double infinity, and the NaN that stands for a number that is not defined or was not asked for.
inline constexpr double infinite = std::numeric_limits<double>::infinity();
inline constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

/// Holds a number with its 95 % interval; of positive quantities, value and upper end may be +infinity.
struct Estimate {
  double value = 0;
  double lower = 0;
  double upper = 0;
};

}  // namespace metastable::analysis
