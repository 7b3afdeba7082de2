#pragma once
// Describes the wheel of the law `settled`: a planar rigid body on a plane, its feet, and what bounds its landings.

#include <string>
#include <vector>

#include "dynamics/wheel/wheel.h"

namespace metastable::dynamics {

/// A planar rigid wheel on a plane of constant slope, SI units. The legs end in discs of radius r that reach to l_i
/// from the hub, so a standing foot rolls on its disc. (Of a rigid-body engine with tips of 0.5 mm this gives mean
/// speeds and paces inside their errors; discs about the points at l_i are 0.003 rad/s and 0.5 mm off.)
struct SettledWheel {
  std::vector<double> leg_length = paper_leg_lengths();  ///< l_i [m], in the order they land
  double mass = 1.39;                                    ///< M [kg], > 0
  double radius_of_gyration = 0.05;                      ///< r_g [m] about the hub, > 0: J = M r_g^2
  double tip_radius = 0;                                 ///< r [m], in [0, shortest leg / 20]
  double gravity = 9.81;                                 ///< g [m/s^2], > 0
  double slope_rad = 0;                                  ///< gamma, in (0, pi / legs)
  /// The torque against the spin: constant [N m], by omega [N m s], by omega |omega| [N m s^2]; all >= 0.
  double constant_drag = 0, linear_drag = 0, quadratic_drag = 0;

  double rest_speed = 1e-5;  ///< v_tol [m/s], > 0: a foot stays down once its bounce is slower
  double tolerance = 1e-12;  ///< of one integration step [rad, rad/s, m/s, m], > 0
  int max_events = 20000;    ///< strikes, lifts, steps of integration; a landing that needs more is given up

  bool operator==(const SettledWheel&) const = default;
  int legs() const { return static_cast<int>(leg_length.size()); }
  double leg_angle() const;
  /// Spans the hub and the centre of a leg's tip, l_i - r [m]. @param leg any whole number, counted around the wheel
  double length(int leg) const;
  double gyration_sq() const { return radius_of_gyration * radius_of_gyration; }
  bool drags() const { return constant_drag > 0 || linear_drag > 0 || quadratic_drag > 0; }
  /// Returns torque / M [m^2/s^2], against the spin.
  double drag(double spin) const;
  /// @throws std::invalid_argument naming the quantity, its value and the allowed range.
  void validate() const;
};

/// Returns the wheel as the other laws have it, r_g as of contact_model(). @param slope gamma [rad]
/// @throws std::invalid_argument as validate() and contact_model()
SettledWheel settled_wheel(const Wheel& wheel, double slope);

/// A foot that stands, seen along its leg's angle a past the normal of the plane [rad]; energies per unit mass.
class StandingFoot {
 public:
  /// @param leg any whole number, counted around the wheel
  StandingFoot(const SettledWheel& wheel, int leg);

  double landing_angle() const { return landing_; }  ///< a when it touches: the leg before it stands, too [rad]
  double next_angle() const { return next_; }        ///< a when the next leg touches [rad]
  double apex_angle() const { return apex_; }        ///< a at the top of the barrier [rad]
  /// Returns (J/M + distance^2 of hub and contact) [m^2].
  double inertia(double angle) const;
  /// Returns that of gravity, from the foot that stood upright at the origin [m^2/s^2].
  double potential(double angle) const;
  double energy(double angle, double spin) const { return inertia(angle) * spin * spin / 2 + potential(angle); }
  double spin_squared(double angle, double energy) const { return 2 * (energy - potential(angle)) / inertia(angle); }
  /// Returns omega-^2 at the next touch of a foot with omega_eq^2 at its landing angle, and back. No drag.
  double next_squared(double omega_eq_squared) const;
  double landing_squared(double next_squared) const;
  /// Returns the time from its landing angle to the next touch, with omega-^2 there [s]: Gauss-Legendre in the variable
  /// in which passing the barrier is smooth, to 1e-9. A wheel that only just passes takes longest, however little it
  /// has left (1e-14 of the energy at the next touch). No drag.
  double duration(double next_squared) const;
  /// Returns the least omega_eq^2 that passes the barrier [rad^2/s^2].
  double barrier_squared() const { return barrier_; }
  /// Measures from touch to touch of two standing feet [m]: chord of the next landing plus what the tip rolls.
  double pace() const { return pace_; }

 private:
  double length_, radius_, gravity_, gyration_sq_, sine_, cosine_;
  double landing_, next_, apex_, pace_;
  double landing_inertia_, next_inertia_, fall_, barrier_;
};

/// Restitutions above it make feet hop for longer than a step.
inline constexpr double most_settled_restitution = 0.95;

/// Returns the friction from which a rolling wheel's landing on `leg` does not slip, mu_c = d h / (J/M + h^2).
double sticking_friction(const SettledWheel& wheel, int leg);
/// A margin above mu_c so large that the foot sticks under its weight, too, on every slope with a barrier.
inline constexpr double clear_of_sticking = 0.02;

}  // namespace metastable::dynamics
