#pragma once
// Encloses omega+^2/omega^2 of the law `published`: the function whose level sets are the landings.

#include <stdexcept>

#include "dynamics/bounds/interval.h"
#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Says why there are no proven bounds for a map.
class NoBounds : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Holds a = 1/A, b = mu B/A^2 and u = mu B/A with their first two derivatives in mu; A = 1/m_-, B = mu/n_- of (5),
/// linear in mu.
template <class T>
struct FrictionTerms {
  T a, a1, a2, b, b1, b2, u, u1, u2;
};

/// Holds k1 = kappa (1 - eta^2), k2 = kappa (1 + eta)^2, k3 = delta (1 + eta) T_r, or their derivatives in eta.
struct RestitutionTerms {
  Interval k1, k2, k3;
};

/// Encloses G(mu, eta, q) = kept - k1 a - k2 b - q k3 u, q = 1/omega, for a rolling wheel (u0 = 0) at one phase: (19),
/// (21), (33) with zeta = 0, tau = 1 + eta. Constants taken from the map are widened by 2^-46 of their values.
class PublishedLevel {
 public:
  /// @throws NoBounds for another law, or a landing that cannot be shown to rise with the state: with mu_c below, s >=
  /// 0
  ///         on mu < mu_c is verified, where the drag may be negative
  PublishedLevel(const WheelMap& map, int phase);

  FrictionTerms<Interval> at(const Interval& mu) const;
  FrictionTerms<double> roughly_at(double mu) const;  ///< not enclosed
  RestitutionTerms drive(const Interval& eta) const;
  RestitutionTerms drive_slope(const Interval& eta) const;
  RestitutionTerms drive_bend(const Interval& eta) const;

  Interval kept;           ///< I_1/I_2
  Interval kappa, delta;   ///< c^2/I_2 [kg], and the factor of T_r in the drag
  Interval barrier, gain;  ///< [rad^2/s^2]
  Interval inverse_mass;   ///< A at mu = 0
  double turn = 0;         ///< upper bound of mu_c = x y/(r^2 + y^2), from where on a, b and u rise with mu
  double jam = 0;          ///< lower bound of the mu at which the foot jams

 private:
  Interval mass0_, mass1_, force0_, force1_;  // A = mass0 - mass1 mu, B = force0 + force1 mu
};

}  // namespace metastable::dynamics
