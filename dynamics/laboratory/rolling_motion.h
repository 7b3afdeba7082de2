#pragma once
// A rimless wheel moves in continuous time, on one foot or in flight: the laboratory's counterpart of the stance.

#include <optional>
#include <vector>

#include "dynamics/laboratory/ramp_surface.h"

namespace metastable::dynamics {

/// Describes what rolls; all is in SI units.
struct RollingBody {
  std::vector<double> leg_length;  ///< [m], in the order they land
  double mass = 0;                 ///< [kg]
  double gravity = 9.81;
  double slope_rad = 0;         ///< of the plane
  double offset = 0;            ///< of the centre of mass from the hub [m]
  double offset_angle_rad = 0;  ///< from leg 0, the way the landing legs follow each other [rad]
  double constant_drag = 0;     ///< resisting torque [N m]
  double linear_drag = 0;       ///< [N m s]
  double quadratic_drag = 0;    ///< [N m s^2]
  double fluid_inertia = 0;     ///< of a fluid in the hub [kg m^2]
  double fluid_coupling = 0;    ///< torque between fluid and hub over their difference of speed [N m s]
  bool flight = true;           ///< false: a foot that should lift stays

  int legs() const { return static_cast<int>(leg_length.size()); }
  double leg_angle() const;
};

struct Point {
  double x = 0, z = 0;  ///< down the plane, out of it [m]
};

/// Says how the wheel stands on one foot, or just off it. `angle_rad` is how far the hub has passed over the foot's
/// leg, from the normal of the plane [rad]; it grows as the wheel rolls down, at `speed` [rad/s].
struct Pose {
  Point foot;
  int leg = 0;
  double angle_rad = 0;
  double speed = 0;
  double fluid_speed = 0;  ///< [rad/s]
};

/// Say where hub, tip of a leg and centre of mass are in that pose.
Point hub(const RollingBody& body, const Pose& pose);
Point tip(const RollingBody& body, const Pose& pose, int leg);
Point centre_of_mass(const RollingBody& body, const Pose& pose);

/// Says what ends a roll.
enum class RollEnd { touch, rest };

struct Touch {
  RollEnd end = RollEnd::rest;
  double time = 0;      ///< [s] since the start
  int leg = 0;          ///< that touches; the stance leg itself after a hop
  Pose before;          ///< at the moment of touch, still as seen from the old foot
  double turn_rad = 0;  ///< how far the wheel has turned
  Point tip_velocity;   ///< of the leg that touches [m/s]
  double energy = 0;    ///< kinetic, of the wheel without the fluid [J]
  bool flew = false;    ///< the foot had lifted
};

/// Holds what a camera sees of the motion in one moment.
struct Moment {
  double time = 0, turn_rad = 0, speed = 0;  ///< [s], [rad], [rad/s] since the start
};

/// Returns the inertia about the foot in that pose [kg m^2]. @param inertia for a centre of mass at the hub [kg m^2]
double inertia_about_foot(const RollingBody& body, const Pose& pose, double inertia);

/// Returns the next leg's touch in a pose that stands on its foot, at time 0.
Touch touch_standing(const RollingBody& body, const Pose& pose, double inertia);

/// Goes from a pose to the next touch of a foot, or to rest. It solves the pendulum equation with drags, by Runge-Kutta
/// of order 8 (relative error about 1e-11), touch, turning back and lift found as events; a wheel whose ground reaction
/// vanishes flies on its parabola until a tip meets the surface.
/// @param inertia about the foot, for a centre of mass at the hub [kg m^2]
/// @param moments if given, gets the accepted steps
Touch roll_on(const RollingBody& body, const RampSurface& surface, const Pose& start, double inertia,
              std::vector<Moment>* moments = nullptr);

/// Returns the motion that led to a pose, backwards in time for at most `seconds`, to the start of that stance or to
/// where the wheel was held: moments with rising, not positive times and turns, the last one at (0, 0).
std::vector<Moment> run_up(const RollingBody& body, const RampSurface& surface, const Pose& end, double inertia,
                           double seconds);

/// Stands the wheel on both feet: `leg` is about to land at (along, surface), and its predecessor is the stance leg.
Pose landing_pose(const RollingBody& body, const RampSurface& surface, int leg, double along, double speed);

}  // namespace metastable::dynamics
