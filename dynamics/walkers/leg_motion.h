#pragma once
// Follows two stiff legs joined at a hip from one strike to the next, by Taylor series, many walkers at once.

#include <array>
#include <cstddef>
#include <optional>
#include <span>

namespace metastable::dynamics {

/// Holds both legs during a step, by their angles to the slope's normal [rad], rates [rad/s]. The hip is over the
/// stance foot at angle 0, uphill of it at positive angles.
struct LegMotion {
  double time = 0;  ///< since the last strike [s]
  double stance_angle = 0, swing_angle = 0;
  double stance_rate = 0, swing_rate = 0;
};

/// Holds the numbers of the equations of motion. With theta and psi the angles of stance and swing leg, gamma the
/// slope,
///   theta'' - p cos(theta - psi) psi'' - p sin(theta - psi) psi'^2   =  q sin(theta - gamma) - T / A
///   psi''   - r cos(theta - psi) theta'' + r sin(theta - psi) theta'^2 = -w sin(psi - gamma) + T / C,
/// where T is the torque of a hip that resists turning, damping times (theta' - psi') and a friction of constant size,
/// A and C the inertias of stance leg with hip, and of the swing leg about it.
struct LegEquations {
  double p = 0, q = 0, r = 0, w = 0;               ///< q, w [1/s^2]
  double stance_damping = 0, swing_damping = 0;    ///< damping over A, over C [1/s]
  double stance_friction = 0, swing_friction = 0;  ///< friction over A, over C [1/s^2]
};

/// Says how a step is followed; times in [s].
struct LegCourse {
  double taylor_step = 0;
  double longest = 0;      ///< a walker whose foot has not struck by then has fallen
  double swing_ratio = 1;  ///< length of the swing leg over that of the stance leg; no unit
};

inline constexpr std::size_t legs_at_once = 128;
using StruckLegs = std::array<std::optional<LegMotion>, legs_at_once>;

/// Follows up to legs_at_once walkers to just before their feet strike. The swing foot strikes when it comes down
/// before the stance foot. Nothing is returned of a walker whose stance leg
/// lies down, or that takes longer than `course.longest`.
/// A walker's bits do not depend on the others.
/// @param from, slopes [rad], equations, courses  of each walker
StruckLegs follow_legs(std::span<const LegMotion> from, std::span<const double> slopes,
                       std::span<const LegEquations> equations, std::span<const LegCourse> courses);

/// Returns the motion `time` >= 0 [s] after `from`, whether or not a foot has struck by then.
LegMotion legs_at(const LegMotion& from, double slope, const LegEquations& equations, double taylor_step, double time);

}  // namespace metastable::dynamics
