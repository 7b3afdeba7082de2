#pragma once
// Says how fast a wheel is launched: a truncated normal, or any distribution given by its quantiles.

#include <optional>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {

/// The distribution of omega_0, the speed just before collision 1 [rad/s], never below 0.
class LaunchSpeed {
 public:
  /// Takes a normal, cut off at 0 where it reaches below.
  LaunchSpeed(const TruncatedNormal& normal);  // NOLINT(google-explicit-constructor): a normal is one
  /// Takes the speeds [rad/s], >= 0, at rising standard normal scores, and a monotone cubic between them (Fritsch and
  /// Carlson, SIAM J. Numer. Anal. 17, 1980); beyond the ends the speed stays. One entry is a constant.
  /// @throws std::invalid_argument where a list is empty, they differ in length, or one of them falls
  LaunchSpeed(std::vector<double> score, std::vector<double> speed);

  /// Returns the speed whose distribution function is Phi(score): ascending.
  double at_score(double score) const;
  /// Returns the density at a speed, 0 where there is none. @throws std::logic_error for a constant
  double density(double speed) const;
  bool constant() const;
  /// Return mean and sd of the speed itself.
  double mean() const;
  double sd() const;
  /// Returns the normal it was made of; nothing for quantiles.
  const std::optional<TruncatedNormal>& normal() const { return normal_; }

 private:
  double expect(int power, double about) const;

  std::optional<TruncatedNormal> normal_;
  std::vector<double> score_, speed_, slope_;  // slope: d speed / d score at each
};

}  // namespace metastable::dynamics
