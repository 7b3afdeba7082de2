#include "analysis/statistics/t_interval.h"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>

namespace metastable::analysis {

double t_half_width(double standard_error, std::size_t count) {
  if (count < 2) throw std::invalid_argument("t interval: fewer than two values");
  return boost::math::quantile(boost::math::students_t(static_cast<double>(count - 1)), 0.975) * standard_error;
}

TInterval t_interval(const std::vector<double>& sample) {
  const auto n = static_cast<double>(sample.size());
  double mean = 0, square = 0;
  for (const double x : sample) mean += x / n;
  for (const double x : sample) square += (x - mean) * (x - mean);
  return {mean, t_half_width(std::sqrt(square / (n - 1) / n), sample.size())};
}

}  // namespace metastable::analysis
