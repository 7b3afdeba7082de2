#include "analysis/wheel_model/score_tilt.h"

#include <algorithm>
#include <cmath>

namespace metastable::analysis {
namespace {

double exponent(double skew, double weight, double u) {
  const double x = 2 * u - 1, x2 = x * x;
  return skew * 2.6457513110645907 * x * (2.5 * x2 - 1.5) + weight * 3 * ((35 * x2 - 30) * x2 + 3) / 8;
}

}  // namespace

ScoreTilt::ScoreTilt(double skew, double weight) : skew_(skew), weight_(weight) {
  if (skew == 0 && weight == 0) return;
  double sum = 0;
  largest_ = 0;
  for (int i = 0; i < cells; ++i) {  // Simpson's rule a cell
    const double left = static_cast<double>(i) / cells, h = 1.0 / cells;
    const auto f = [&](double u) { return std::exp(exponent(skew, weight, u)); };
    sum += h / 6 * (f(left) + 4 * f(left + h / 2) + f(left + h));
    below_[static_cast<std::size_t>(i) + 1] = sum;
    largest_ = std::max({largest_, f(left), f(left + h)});
  }
  for (double& b : below_) b /= sum;
  largest_ /= sum;
  log_mass_ = std::log(sum);
}

double ScoreTilt::log_density(double u) const {
  return skew_ == 0 && weight_ == 0 ? 0 : exponent(skew_, weight_, u) - log_mass_;
}

double ScoreTilt::below(double u) const {
  if (skew_ == 0 && weight_ == 0) return u;
  // Within a cell it goes from the nearer end, so that both tails keep their relative accuracy.
  const double at = std::clamp(u, 0.0, 1.0) * cells;
  const auto i = static_cast<std::size_t>(std::min<double>(cells - 1, std::floor(at)));
  const double left = static_cast<double>(i) / cells, h = u - left;
  const auto f = [&](double v) { return std::exp(exponent(skew_, weight_, v) - log_mass_); };
  return below_[i] + h / 6 * (f(left) + 4 * f(left + h / 2) + f(u));
}

}  // namespace metastable::analysis
