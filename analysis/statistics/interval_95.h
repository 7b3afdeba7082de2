#pragma once
// Finds 95 % intervals: of a normal estimate, of a share, and of the mean of a small sample.

#include <cstddef>
#include <vector>

#include "analysis/statistics/estimate.h"
#include "markov/normal_95.h"

namespace metastable::analysis {

using markov::normal_95;

/// The same of a 90 % interval.
inline constexpr double normal_90 = 1.6448536269514722;

/// Returns count/of with its exact binomial 95 % interval (Clopper and Pearson 1934). O(1).
/// @param count  <= of
/// @param of     >= 1
/// @throws std::invalid_argument for none, or for more than there are
Estimate exact_share(std::size_t count, std::size_t of);

struct TInterval {
  double mean = 0;
  double half_width = 0;  ///< of the 95 % interval of the mean, Student's t
};

/// Returns the half-width of the 95 % interval of a mean of `count` >= 2 values (std::invalid_argument
/// otherwise).
double t_half_width(double standard_error, std::size_t count);

/// @param sample  independent, roughly normal values, at least 2 (std::invalid_argument otherwise)
TInterval t_interval(const std::vector<double>& sample);

}  // namespace metastable::analysis
