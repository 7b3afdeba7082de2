#pragma once
// Makes a smooth change of shape of a distribution a nuisance: contact noise is not exactly normal.

#include <array>

namespace metastable::analysis {

/// Has the density exp(skew P3(u) + weight P4(u)) / C of the probability integral transform u in [0, 1], with
/// orthonormal shifted Legendre polynomials: after contact means and spreads are refitted, what is left of a skewed or
/// flatter distribution, but not of rare outliers.
class ScoreTilt {
 public:
  ScoreTilt(double skew, double weight);
  /// Return the log density at u, and the distribution function there.
  double log_density(double u) const;
  double below(double u) const;
  double largest_density() const { return largest_; }

 private:
  double skew_, weight_, log_mass_ = 0, largest_ = 1;
  static constexpr int cells = 128;
  std::array<double, cells + 1> below_{};
};

}  // namespace metastable::analysis
