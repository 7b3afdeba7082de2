#pragma once
// Follows a wheel with no foot on the ground until a tip touches.

#include <optional>
#include <span>

#include "dynamics/settled/settled_wheel.h"

namespace metastable::dynamics {

/// A hub in the air, and the leg from which legs are counted.
struct FlyingHub {
  int leg = 0;
  double angle = 0;   ///< of that leg past the plane's normal [rad]
  double height = 0;  ///< over the plane [m]
  double out = 0;     ///< speed away from it [m/s]
  double spin = 0;    ///< [rad/s]
  double press = 0;   ///< gravity into the plane [m/s^2]
};

/// A stretch of flight: a parabola at constant angular acceleration, which ends in a touch or is continued by another
/// stretch.
struct Flight {
  double slowing = 0;          ///< angular acceleration [rad/s^2]
  double lasts = 0;            ///< [s]
  bool high = false;           ///< the hub is higher than legs are long
  std::optional<int> touches;  ///< leg whose tip touches at its end
  bool lost = false;           ///< numbers do not resolve where a tip touches
};

/// Returns the flight from now on, to the first touch of a tip or to where other legs may touch.
/// @param lifting  legs that leave the plane, where their tips are exactly
Flight next_flight(const SettledWheel& wheel, const FlyingHub& hub, std::span<const int> lifting);

}  // namespace metastable::dynamics
