#pragma once
// Holds a number with its interval.

namespace metastable::analysis {

/// Holds a number with its 95 % interval; of positive quantities, value and upper end may be +infinity.
struct Estimate {
  double value = 0;
  double lower = 0;
  double upper = 0;
};

}  // namespace metastable::analysis
