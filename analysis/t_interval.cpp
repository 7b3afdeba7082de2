#include "analysis/t_interval.h"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>

namespace metastable::analysis {

TInterval t_interval(const std::vector<double>& sample) {
  if (sample.size() < 2) throw std::invalid_argument("t interval: fewer than two values");
  const auto n = static_cast<double>(sample.size());
  double mean = 0, square = 0;
  for (const double x : sample) mean += x / n;
  for (const double x : sample) square += (x - mean) * (x - mean);
  const boost::math::students_t t(n - 1);
  return {mean, boost::math::quantile(t, 0.975) * std::sqrt(square / (n - 1) / n)};
}

}  // namespace metastable::analysis
