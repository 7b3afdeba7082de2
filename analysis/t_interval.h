#pragma once
// Mean and 95 % half-width of a small sample.

#include <vector>

namespace metastable::analysis {

struct TInterval {
  double mean = 0;
  double half_width = 0;  ///< of the 95 % interval of the mean, Student's t
};

/// @param sample  independent, roughly normal values, at least 2 (std::invalid_argument otherwise)
TInterval t_interval(const std::vector<double>& sample);

}  // namespace metastable::analysis
