#pragma once
// Finds periodic gaits on even ground: fixed points by Newton's method, and how perturbations of them grow or fade.

#include <complex>
#include <vector>

#include "dynamics/walkers/two_link_walker.h"

namespace metastable::dynamics {

/// A gait that repeats itself after every step.
struct Gait {
  std::vector<double> state;                      ///< just after a strike, as TwoLinkWalker::step takes it
  std::vector<std::complex<double>> eigenvalues;  ///< of the step's derivative there, by falling modulus
  double residual = 0;                            ///< largest |step(state) - state|
  bool stable() const { return std::abs(eigenvalues.front()) < 1; }
};

/// Finds the gait near `guess` (by default, that of the walker's reference slope, followed to `slope_rad` by small
/// changes of the slope), derivatives by central differences: eigenvalues are good to 1e-8.
/// @throws std::domain_error if there is none within reach: Newton's method leaves the states that walk
Gait find_gait(const TwoLinkWalker& walker, double slope_rad);
Gait find_gait(const TwoLinkWalker& walker, double slope_rad, const std::vector<double>& guess);

}  // namespace metastable::dynamics
