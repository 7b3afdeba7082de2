#pragma once
// Follows the five links of a biped from one strike to the next, by Runge and Kutta's method, four walkers at once.

#include <array>
#include <cstddef>
#include <optional>
#include <span>

namespace metastable::dynamics {

/// Numbers the links, and with them angles and rates.
enum BipedLinkName : std::size_t { stance_shank, stance_thigh, torso, swing_thigh, swing_shank };

/// Holds a motor that turns a joint towards a posture: stiffness times what is missing, damping times the rate.
struct BipedMotor {
  double stiffness = 0;  ///< [N m/rad]
  double damping = 0;    ///< [N m s/rad]
};

/// Holds what the motors are told: postures as functions of the stance leg's angle to the vertical. Legs are lines from
/// foot to hip. The default numbers are one of many postures and gains drawn at random, rounded; most of those drawn
/// walk stably on level ground. Its springs are so soft that four eigenvalues of a step's derivative exceed 0.2.
struct BipedPosture {
  double half_step_rad = 0.25;  ///< > 0: the stance leg is meant to go from minus this angle to this angle
  double swing_share = 0.75;    ///< of that way after which the swing leg is in front, in (0, 1]
  double knee_rad = 0.2;        ///< bend of both knees as feet strike
  double lift_rad = 0.6;        ///< bend of the swing knee beyond that in mid-step
  double lean_rad = 0.12;       ///< of the torso, forward
  BipedMotor stance_knee{800, 60}, swing_knee{300, 15}, torso{100, 10}, swing_leg{400, 20};
};

/// Holds what the equations of motion need. Times cosines of differences of angles, `inertia` is the mass matrix; times
/// sines of angles to the vertical, `weight` is the torque of gravity.
struct BipedEquations {
  std::array<std::array<double, 5>, 5> inertia{};
  std::array<double, 5> weight{};
  BipedPosture posture;
};

/// Holds all five links by their angles to the slope's normal [rad], positive where the upper end (of shanks and thighs
/// the one nearer to the hip) leans forward, and rates [rad/s].
struct BipedMotion {
  double time = 0;  ///< since the last strike [s]
  std::array<double, 5> angles{}, rates{};
};

/// Holds torques [N m]: those of the knees bend them, that of the stance hip turns the torso forward against the stance
/// thigh, that of the swing hip turns the swing thigh forward against the torso.
struct BipedTorques {
  double stance_knee = 0, swing_knee = 0, stance_hip = 0, swing_hip = 0;
};

/// Returns what the motors do.
BipedTorques motor_torques(const BipedPosture& posture, const BipedMotion& motion, double slope);

/// Says whether stance leg and torso are within 1.2 rad of the slope's normal, and knees bent by -0.5 to 2.5 rad.
bool upright(const BipedMotion& motion);

/// Holds forward position and height of the swing foot from the stance foot, and how fast it sinks, in lengths of a
/// segment.
struct BipedFoot {
  double ahead = 0, height = 0, sinking = 0;
};
BipedFoot swing_foot(const BipedMotion& motion);

/// Follows walkers, in pieces of 1/128 s, to just before their feet strike: nothing of those that come to be not
/// upright, whose foot touches the ground before it has passed the stance foot (looked for at the ends of pieces), or
/// that take 3 s. A walker's bits do not depend on the others.
/// @param slopes  of each [rad]
void follow_links(const BipedEquations& equations, std::span<const BipedMotion> from, std::span<const double> slopes,
                  std::span<std::optional<BipedMotion>> struck);

/// Returns the motion `time` [s] later, whether or not the foot has struck by then, in steps of `longest` [s], 1/128 s
/// at most.
BipedMotion links_at(const BipedEquations& equations, const BipedMotion& from, double slope, double time,
                     double longest);

}  // namespace metastable::dynamics
