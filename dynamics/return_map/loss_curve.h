#pragma once
// Says what one collision costs, as a function of friction at a given restitution.

#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Knows the loss [J] of a rolling wheel's collision (u0 = 0) at `phase` with x = omega^2 [rad^2/s^2] = state, > 0.
///
/// g(mu) = a/A + b mu B/A^2 + c mu B/A with A = 1/m_- and B = mu/n_- linear in mu (the paper's (19), (21), (33)); a, b,
/// c depend on eta. `published`: it falls to its least value and rises until the foot jams. `coulomb`: it rises to its
/// largest value and falls until mu_c, from where on the foot sticks and the loss is that at mu_c.
class LossCurve {
 public:
  /// Describes g at one eta.
  struct Coefficients {
    double a, b, c;
  };
  struct Extreme {
    double friction, loss;
  };

  /// `map.law()` is `published` or `coulomb`, its noise normal. O(1).
  LossCurve(const WheelMap& map, double state, int phase);

  Coefficients at(double restitution) const;
  /// Returns the loss [J] at mu in [0, end()).
  double loss(const Coefficients& k, double friction) const;
  /// Returns d loss / d mu.
  double slope(const Coefficients& k, double friction) const;
  /// Finds the least loss over [0, end()] (`coulomb`: the largest), by Newton's method in a bracket from near `guess`.
  Extreme extreme(const Coefficients& k, double guess) const;
  /// Finds the one mu in [from, to] with loss = level, by Newton's method within a bracket from near `guess`.
  double root(const Coefficients& k, double level, double from, double to, bool rising, double guess) const;

  /// Return the loss after which the next state is `next`, and the next state after a loss.
  double level(double next) const { return (available_ - inertia_ * (next - gain_)) / 2; }
  double landing(double loss) const { return (available_ - 2 * loss) / inertia_ + gain_; }
  double lowest() const { return lowest_; }    ///< state of a survivor
  double inertia() const { return inertia_; }  ///< of the stance after the collision [kg m^2]
  /// Returns the mu at which the foot sticks (`coulomb`) or jams (`published`), or beyond which its density underflows.
  double end() const { return end_; }
  bool coulomb() const { return coulomb_; }
  /// Return A at mu, and what remains of eta^2 and of the energy in a: a = energy (1 - kept eta^2).
  double normal(double friction) const { return normal_0_ - normal_1_ * friction; }
  double energy() const { return energy_; }
  double kept() const { return kept_; }
  /// Says whether the foot jams at end().
  bool jams() const { return !coulomb_ && normal(end_) <= 1e-15 * normal_0_; }

 private:
  double stationary_polynomial(const Coefficients& k, double friction) const;

  bool coulomb_ = false;
  double lowest_ = 0, gain_ = 0, inertia_ = 0, available_ = 0;  // I2, I1 x
  double normal_0_ = 0, normal_1_ = 0;                          // A = normal_0 - normal_1 mu
  double tangential_0_ = 0, tangential_1_ = 0;                  // B = tangential_1 mu - tangential_0
  double energy_ = 0;                                           // c^2 x / 2
  double pull_ = 0;                                             // M g sin(gamma) c omega / 2
  double stretch_ = 0;                                          // sqrt(m_c / K_r)
  double kept_ = 1;                                             // 1 - rebound_lost
  double end_ = 0;
};

}  // namespace metastable::dynamics
