#pragma once
// Cuts the normal distribution to an interval, exactly in both tails.

#include <limits>
#include <optional>

namespace metastable::dynamics {

/// Returns Phi(z), with relative accuracy in the lower tail (erfc); the upper tail is normal_cdf(-z).
double normal_cdf(double z);
/// Returns the density of the standard normal.
double normal_density(double z);
/// Returns the score whose lower tail probability is p. @throws std::domain_error for p outside (0, 1)
double normal_quantile(double p);

/// Represents N(mean, sd^2) conditioned on [lower, upper]. `mean` and `sd` are those of the untruncated normal.
/// sd = 0 is a constant.
class TruncatedNormal {
 public:
  /// @throws std::invalid_argument: sd < 0, NaN, lower >= upper, a constant outside [lower, upper], or less than
  ///         1e-290 of the normal's mass inside ("empty truncation").
  TruncatedNormal(double mean, double sd, double lower = -std::numeric_limits<double>::infinity(),
                  double upper = std::numeric_limits<double>::infinity());

  double mean() const { return mean_; }  ///< of the untruncated normal
  double sd() const { return sd_; }      ///< of the untruncated normal
  double lower() const { return lower_; }
  double upper() const { return upper_; }
  bool constant() const { return sd_ == 0; }

  /// Returns P(from < X <= to), with relative accuracy wherever the interval lies; 0 if from >= to.
  double between(double from, double to) const;
  /// Return P(X <= x) and P(X > x), each with relative accuracy.
  double cdf(double x) const;
  double complement(double x) const;
  /// Returns the density at x, 0 outside [lower, upper]. @throws std::logic_error for a constant
  double density(double x) const;
  /// Returns the x whose cdf is Phi(score) and whose complement is Phi(-score): monotone, within rounding of x (or of
  /// the sd, if larger) for |score| up to 37, as long as the untruncated normal's tail at x exceeds 1e-307; within 1e-4
  /// sd of a bound within rounding of the distance from it.
  double at_score(double score) const;
  /// Return mean and sd of the truncated variable itself.
  double truncated_mean() const;
  double truncated_sd() const;

 private:
  double untruncated(double from, double to) const;
  std::optional<double> beyond_bound(double a, double probability) const;

  double mean_, sd_, lower_, upper_;
  double below_lower_ = 0, above_lower_ = 1;  // Phi, 1 - Phi at the lower bound
  double below_upper_ = 1, above_upper_ = 0;  // at the upper bound
  double mass_ = 1;                           // of the untruncated normal inside [lower, upper]
};

}  // namespace metastable::dynamics
