#pragma once
// Moves the stance in time: the wheel is an inverted pendulum on the foot that has landed.

#include <utility>

namespace metastable::dynamics {

/// Says where the stance leg is and how fast it turns.
struct StanceState {
  double angle =
      0;  ///< of the stance leg to the horizontal, theta [rad]; rises as the wheel rolls down, pi/2 at the apex
  double speed = 0;  ///< omega = dtheta/dt [rad/s]; negative: falling back
};

/// Returns the stance `time` seconds later (earlier, if negative): theta'' = -(pendulum/2) cos(theta), which is what
/// conserving omega^2 + pendulum sin(theta) means. It takes Runge-Kutta of order 4 with steps of at most 1/64 of the
/// pendulum's time sqrt(2/pendulum): relative error below 1e-8 over a step of the wheel. O(|time|).
/// @param pendulum  2 M g L / I [rad^2/s^2], > 0 (Stance::pendulum)
StanceState stance_motion(double pendulum, StanceState start, double time);

/// Returns the time from `start` (speed > 0) to the first passage of `angle` > start.angle and the speed there;
/// infinite if the wheel turns back before. Bisection on stance_motion() inside the step that passes it, to 1e-12 s.
std::pair<double, double> stance_passage(double pendulum, StanceState start, double angle);

}  // namespace metastable::dynamics
