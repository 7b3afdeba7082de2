#include "dynamics/numerics/truncated_normal.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/policies/policy.hpp>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

// Returns E f(Z) of a standard normal score: the trapezoidal rule converges exponentially for analytic f.
template <class F>
double expectation(F f) {
  constexpr double step = 1.0 / 16;
  constexpr int reach = 10 * 16;  // scores up to 10
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) sum += normal_density(i * step) * f(i * step);
  return sum * step;
}

}  // namespace

double normal_cdf(double z) { return 0.5 * std::erfc(-z * (std::numbers::sqrt2 / 2)); }

double normal_density(double z) {
  constexpr double inverse_sqrt_two_pi = std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  return inverse_sqrt_two_pi * std::exp(-0.5 * z * z);
}

double normal_quantile(double p) {
  if (!(p > 0 && p < 1)) throw std::domain_error(fmt::format("probability: {} is outside (0, 1)", p));
  return -std::numbers::sqrt2 * boost::math::erfc_inv(2 * p, Policy());
}

TruncatedNormal::TruncatedNormal(double mean, double sd, double lower, double upper)
    : mean_(mean), sd_(sd), lower_(lower), upper_(upper) {
  if (!std::isfinite(mean)) throw std::invalid_argument(fmt::format("mean: {} is not a finite number", mean));
  if (!(sd >= 0) || !std::isfinite(sd)) throw std::invalid_argument(fmt::format("sd: {} is outside [0, inf)", sd));
  if (!(lower < upper)) throw std::invalid_argument(fmt::format("bounds: [{}, {}] is not an interval", lower, upper));
  if (constant()) {
    if (mean < lower || mean > upper)
      throw std::invalid_argument(fmt::format("mean: the constant {} is outside [{}, {}]", mean, lower, upper));
    return;
  }
  const double a = (lower - mean) / sd, b = (upper - mean) / sd;
  below_lower_ = normal_cdf(a);
  above_lower_ = normal_cdf(-a);
  below_upper_ = normal_cdf(b);
  above_upper_ = normal_cdf(-b);
  mass_ = untruncated(lower, upper);
  if (!(mass_ >= 1e-290))
    throw std::invalid_argument(fmt::format(
        "empty truncation: N({}, {}^2) has less than 1e-290 of its mass in [{}, {}]", mean, sd, lower, upper));
}

// Returns the untruncated mass between two points of [lower, upper]; short intervals are integrated, because the
// difference of two tails would cancel.
double TruncatedNormal::untruncated(double from, double to) const {
  const double a = (from - mean_) / sd_, b = (to - mean_) / sd_;
  const double width = (to - from) / sd_;
  if (width * std::max({1.0, std::abs(a), std::abs(b)}) < 0.5)
    return width * boost::math::quadrature::gauss<double, 10>::integrate(
                       [&](double t) { return normal_density(a + width * t); }, 0.0, 1.0);
  if (a > 0) return normal_cdf(-a) - normal_cdf(-b);
  if (b < 0) return normal_cdf(b) - normal_cdf(a);
  return 1 - normal_cdf(a) - normal_cdf(-b);
}

double TruncatedNormal::between(double from, double to) const {
  if (constant()) return from < mean_ && mean_ <= to ? 1 : 0;
  from = std::max(from, lower_);
  to = std::min(to, upper_);
  return from < to ? std::min(1.0, untruncated(from, to) / mass_) : 0;
}

double TruncatedNormal::cdf(double x) const { return between(-std::numeric_limits<double>::infinity(), x); }

double TruncatedNormal::complement(double x) const { return between(x, std::numeric_limits<double>::infinity()); }

double TruncatedNormal::density(double x) const {
  if (constant()) throw std::logic_error("density: a constant has none");
  if (x < lower_ || x > upper_) return 0;
  return normal_density((x - mean_) / sd_) / (sd_ * mass_);
}

// Returns the distance from a bound that holds the share `probability`, where lower + sd * score would keep no
// digits of it: the series of the inverse distribution function there. `a` is the bound's score, negated if it is the
// upper one.
std::optional<double> TruncatedNormal::beyond_bound(double a, double probability) const {
  constexpr double close = 1e-4;  // [sd]: four terms leave 1e-16 of the distance
  if (!std::isfinite(a)) return std::nullopt;
  const double w = probability * mass_ / normal_density(a);
  if (!(w * std::max(1.0, std::abs(a)) < close)) return std::nullopt;
  return sd_ * w * (1 + w * (a / 2 + w * ((2 * a * a + 1) / 6 + w * a * (6 * a * a + 7) / 24)));
}

double TruncatedNormal::at_score(double score) const {
  if (constant()) return mean_;
  if (below_lower_ == 0 && above_upper_ == 0) return std::clamp(mean_ + sd_ * score, lower_, upper_);
  // These are the untruncated tails at x: positive mixtures of those at the bounds, so nothing cancels.
  const double p = normal_cdf(score), q = normal_cdf(-score);
  if (const auto d = beyond_bound((lower_ - mean_) / sd_, p)) return lower_ + *d;
  if (const auto d = beyond_bound((mean_ - upper_) / sd_, q)) return upper_ - *d;
  const double below = q * below_lower_ + p * below_upper_;
  const double above = q * above_lower_ + p * above_upper_;
  const double smaller = std::min(below, above);
  if (smaller <= 0) return below < above ? lower_ : upper_;
  const double z = normal_quantile(smaller);
  return std::clamp(mean_ + sd_ * (below < above ? z : -z), lower_, upper_);
}

double TruncatedNormal::truncated_mean() const {
  if (constant()) return mean_;
  return expectation([this](double score) { return at_score(score); });
}

double TruncatedNormal::truncated_sd() const {
  if (constant()) return 0;
  const double centre = truncated_mean();
  return std::sqrt(expectation([&](double score) {
    const double d = at_score(score) - centre;
    return d * d;
  }));
}

}  // namespace metastable::dynamics
