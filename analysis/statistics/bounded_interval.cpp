#include "analysis/statistics/bounded_interval.h"

#include <algorithm>
#include <boost/math/tools/roots.hpp>
#include <cmath>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double coverage = 0.9;

template <class Function>  // that rises or falls through 0 between the two
double root(Function function, double low, double high) {
  const auto [a, b] = boost::math::tools::bisect(function, low, high, boost::math::tools::eps_tolerance<double>(40));
  return (a + b) / 2;
}

// Returns the estimate on the other side of the mean that is as likely, in units of the likelihood of the best mean
// >= 0: that of an estimate below 0 is 0.
double as_likely(double mean, double above) {
  const double off = above - mean;
  return off <= mean ? mean - off : mean / 2 - off * off / (2 * mean);
}

// Returns the ends of the estimates that a mean > 0 accepts.
std::pair<double, double> accepted(double mean) {
  const double off = root(
      [&](double d) {
        return dynamics::normal_cdf(d) - dynamics::normal_cdf(as_likely(mean, mean + d) - mean) - coverage;
      },
      1.0, 2.0);
  return {as_likely(mean, mean + off), mean + off};
}

}  // namespace

std::pair<double, double> bounded_interval(double estimate) {
  constexpr double least_mean = 1e-9, widest = 2;  // no limit is further from an estimate >= 0
  const double x = std::max(-10.0, estimate), top = std::max(0.0, x) + widest;
  const double upper = root([&](double mean) { return accepted(mean).first - x; }, least_mean, top);
  if (x <= accepted(least_mean).second) return {0, upper};
  return {root([&](double mean) { return accepted(mean).second - x; }, least_mean, top), upper};
}

}  // namespace metastable::analysis
