#pragma once
// Says where the published law leaves the wheel: densities of the landing for many next states at once.

#include <span>
#include <vector>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Gives the density of the landing x' under `published` for independent eta and mu, both with spreads.
///
/// The loss is v0^2/2 g(eta, mu), g = (1 - eta^2)/A + (1 + eta)^2 mu B/A^2 + kappa (1 + eta) s(eta) mu B/A
/// (the paper's (19), (21), (33), (34)), A = 1/m_- and B = mu/n_- linear in mu, s = sqrt(pi^2 + ln^2 eta). The density
/// is the integral of f(eta) f(mu) / |grad g| along the curve g = level. Above mu_c (B = 0 there) g rises with mu and
/// the curve is a function of eta; below, g falls with eta and the curve is a function of mu: neither part has a fold,
/// and their common end is known in closed form. Each part is a Gauss-Legendre sum over the window that holds all but
/// 1e-9 of it, for many landings at once.
///
/// One thing is not exact: where mu < mu_c, s is taken at sqrt(eta^2 + rounding()^2), rounding() about 0.01. That moves
/// landings by about 1e-4 of their size, with the probability of those mu and of an eta below a few rounding().
/// Launches slower than any survivor take a larger one.
class PublishedDensity {
 public:
  PublishedDensity(const WheelMap& map, int phase);

  /// Sets density[k] [1/(rad^2/s^2)] at next[k], for the collision at `phase` with x = state [rad^2/s^2], > 0.
  /// Below slowest() g may rise with eta, and a curve have a fold.
  /// @return the probability of rest, from the distribution functions with relative accuracy in their tails
  /// @throws std::invalid_argument for spans of different sizes
  double operator()(double state, std::span<const double> next, std::span<double> density) const;

  double rounding() const { return forms_.empty() ? 0 : forms_.front().rounding; }  ///< for survivors
  /// Returns the least state this form holds for, infinite if it holds for none.
  double slowest() const;

  /// Says whether `map` has this form of the density: law published, independent eta and mu whose sds are 0.001 at
  /// least.
  static bool covers(const WheelMap& map);

 private:
  const TruncatedNormal restitution_, friction_;
  double lowest_, gain_, inertia_, before_;  // of the landing; I2, I1
  double energy_, kappa_;                    // at 1 rad/s
  double a0_, a1_, t0_, t1_;                 // A = a0 - a1 mu, B = t1 mu - t0
  double sticking_ = 0;                      // mu_c, or 0
  double lower_ = 0;                         // of eta
  struct Form {
    double slowest, rounding;  // from which state on the rounding is enough
  };
  std::vector<Form> forms_;                      // by falling states; none where mu_c is 0
  std::vector<double> grid_, duration_;          // eta about one sd apart, s there
  std::vector<double> tail_, tail_restitution_;  // -ln eta where eta may be close to 0, eta there
};

}  // namespace metastable::dynamics
