#pragma once
// Finds mean and 95 % half-width of a small sample.

#include <cstddef>
#include <vector>

namespace metastable::analysis {

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
