#include "markov/size_extrapolation.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <cstddef>

namespace metastable::markov {
namespace {

constexpr double least = 0.25;  // of the distance that the coarsest size makes: the error of the value of all sizes

// Returns the value at 0 of the polynomial in h^2 through the values of sizes first .. last - 1, h^2 halving from each
// to the next.
double at_zero(const std::vector<double>& by_size, std::size_t first, std::size_t last) {
  std::vector<double> row(by_size.begin() + static_cast<std::ptrdiff_t>(first),
                          by_size.begin() + static_cast<std::ptrdiff_t>(last));
  for (double factor = 2; row.size() > 1; factor *= 2) {
    for (std::size_t i = 0; i + 1 < row.size(); ++i) row[i] = (factor * row[i + 1] - row[i]) / (factor - 1);
    row.pop_back();
  }
  return row.front();
}

}  // namespace

MeshEstimate estimate_of(const Extrapolated& logarithm) {
  const double value = std::exp(logarithm.value);
  const double factor = std::exp(std::hypot(logarithm.shift_error, logarithm.discretization_error));
  return {value, value / factor, value * factor};
}

Extrapolated extrapolate_sizes(std::span<const std::vector<double>> values) {
  const auto n = static_cast<double>(values.size());
  const std::size_t sizes = values.front().size();
  std::vector<double> by_shift, mean(sizes, 0.0);
  Extrapolated e;
  for (const std::vector<double>& by_size : values) {
    by_shift.push_back(at_zero(by_size, 0, sizes));
    e.value += by_shift.back() / n;
    for (std::size_t i = 0; i < sizes; ++i) mean[i] += by_size[i] / n;
  }
  double spread = 0;
  for (const double value : by_shift) spread += (value - e.value) * (value - e.value);
  const double quantile = boost::math::quantile(boost::math::students_t(n - 1), 0.975);
  e.shift_error = quantile * std::sqrt(spread / (n - 1) / n);
  // The value without the coarsest size errs by about its distance from the value of all sizes. The latter errs by
  // less, in the ratio of that distance to the one from the finest mesh to the value without the coarsest size. Four
  // times this ratio is taken, but at least a quarter and at most one.
  const double before = std::abs(at_zero(mean, 1, sizes) - mean.back());
  e.discretization_error = std::abs(e.value - at_zero(mean, 1, sizes));
  if (before > 0) e.discretization_error *= std::clamp(4 * e.discretization_error / before, least, 1.0);
  // A fourth size is asked for where meshes are too coarse for errors in proportion to h^2. The error is then at least
  // the distance between the values of the three finest and of the three coarsest sizes.
  if (sizes > 3)
    e.discretization_error = std::max(e.discretization_error,
                                      std::abs(at_zero(mean, sizes - 3, sizes) - at_zero(mean, sizes - 4, sizes - 1)));
  return e;
}

}  // namespace metastable::markov
