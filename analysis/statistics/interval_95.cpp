#include "analysis/statistics/interval_95.h"

#include <fmt/format.h>

#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>

namespace metastable::analysis {

Estimate exact_share(std::size_t count, std::size_t of) {
  if (of == 0 || count > of) throw std::invalid_argument(fmt::format("share: {} of {} is no share", count, of));
  using boost::math::beta_distribution;
  const auto k = static_cast<double>(count), n = static_cast<double>(of);
  return {k / n, count == 0 ? 0 : boost::math::quantile(beta_distribution<>(k, n - k + 1), 0.025),
          count == of ? 1 : boost::math::quantile(beta_distribution<>(k + 1, n - k), 0.975)};
}

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
