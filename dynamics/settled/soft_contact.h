#pragma once
// Gives a leg tip a finite stiffness: what the first impact of a landing then is, to first order in its duration.

#include "dynamics/settled/settled_density.h"

namespace metastable::dynamics {

/// An impact on a spring with a damper that gives back a share `restitution` of the approach and does not pull.
/// Times are in units of sqrt(m / k), m the mass that the tip meets and k its stiffness; force and speed follow
/// x'' + 2 damping x' + x = 0 from x = 0, x' = 1 until the force, -x'', vanishes.
struct SpringImpact {
  double damping = 0;    ///< ratio of the critical one
  double lasts = 0;      ///< until the force vanishes
  double depth = 0;      ///< x that is left then
  double weighted = 0;   ///< mean time, weighted by the force
  double run = 0;        ///< integral of the share of the impulse that has been given
  double run_twice = 0;  ///< integral of its square

  /// @param restitution  taken as within [0.01, 0.95]
  explicit SpringImpact(double restitution);
};

/// A wheel whose tips are springs.
class SoftContact {
 public:
  /// @param softness  1 / sqrt(k), k the stiffness of a tip along the normal [(m/N)^(1/2)], >= 0; 0: rigid
  /// @param restitution  mean eta, by which all landings last as long
  SoftContact(double softness, double restitution)
      : softness_(softness), restitution_(restitution), spring_(restitution) {}

  /// Says what else acts on the wheel.
  struct Load {
    double mass = 0;     ///< [kg]
    double gravity = 0;  ///< [m/s^2]
    double slope = 0;    ///< [rad]
  };
  /// Changes the first impact of a landing on rigid tips: while the tip is pressed the wheel turns on, which shortens
  /// the lever of the normal force, and with it mu_c, in proportion to omega; weight and the pull of the turn act, too.
  /// Neglected is what is of second order in the duration, that a foot that slides meets less mass and slows the wheel
  /// more than one that sticks, and that later hops are soft, too. Against an integration of the contact (rigid_roll)
  /// at 3e6 N/m, omega- 4.8 to 6.5 rad/s: omega+ by 1e-3 of omega- for a foot that sticks and 5e-3 for one that slides
  /// at mu_c - 0.03, where softness changes it by 1.5e-2; the next omega- is 0.002 to 0.005 rad/s too small.
  void soften(SettledLanding& landing, const Load& load) const;

 private:
  double softness_, restitution_;
  SpringImpact spring_;
};

}  // namespace metastable::dynamics
