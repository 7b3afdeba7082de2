#pragma once
// A number with its interval.

namespace metastable::analysis {

/// A number with its 95 % interval; of positive quantities, value and upper end may be +infinity.
struct Estimate {
  double value = 0;
  double lower = 0;
  double upper = 0;
};

}  // namespace metastable::analysis
