#pragma once
// Finds the middle of a sample.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace metastable::analysis {

/// Returns the median of values, of an even number the upper of the two in the middle. O(n). @param values  not empty
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the median distance of values from their median. @param values  not empty
inline double median_deviation(std::vector<double> values) {
  const double centre = median(values);
  for (double& one : values) one = std::abs(one - centre);
  return median(std::move(values));
}

/// The median absolute deviation of a normal times this is its standard deviation: 1 / Phi^-1(3/4).
inline constexpr double median_deviation_to_sd = 1.4826;

}  // namespace metastable::analysis
