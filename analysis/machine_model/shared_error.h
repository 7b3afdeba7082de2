#pragma once
// Errors of measurement that neighbouring rows share.

#include <cmath>

namespace metastable::analysis {

/// The error of a row in sds: own times a number of this row plus kept times that of the row before, both independent
/// standard normals.
struct SharedError {
  double own, kept;
};

/// @param correlation  of the errors of neighbouring rows, in [-0.5, 0.5]; 0: own alone
inline SharedError shared_error(double correlation) {
  const double plus = std::sqrt(1 + 2 * correlation), minus = std::sqrt(1 - 2 * correlation);
  return {0.5 * (plus + minus), 0.5 * (plus - minus)};
}

}  // namespace metastable::analysis
