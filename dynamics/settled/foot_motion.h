#pragma once
// Moves a wheel on one foot that sticks or slides: its motion is found as a Taylor series in time.

#include <array>

#include "dynamics/settled/settled_wheel.h"

namespace metastable::dynamics {

/// Holds a wheel on one foot: its leg's angle past the normal, its spin, the speed at which the foot slips down the
/// plane, the place of the tip's centre. SI units.
struct FootState {
  double angle = 0, spin = 0, slip = 0, along = 0;
};

/// A Taylor polynomial in time about 0.
struct TimeSeries {
  static constexpr int order = 16;
  std::array<double, order + 1> term{};
  double at(double time) const;
  double rate(double time) const;
  /// Returns the earliest time in (0, end] at which a value that is positive at first is 0; `end` + 1 if it stays
  /// positive. A value that starts at 0 or below counts as positive if it rises; if it falls, the time is 0.
  double falls_below_zero(double end) const;
};

/// Holds the motion of a wheel on one foot, as far as the series hold.
struct FootMotion {
  TimeSeries angle, spin, slip, along;
  TimeSeries normal, tangential;  ///< contact forces per unit mass [m/s^2]
  TimeSeries stiffness;           ///< [m^2] 0 where slip jams (Painleve); for a sticking foot the inertia / M
  double horizon = 0;             ///< [s]: until then every series is good to the tolerance
  FootState at(double time) const;
};

/// Describes a foot on the ground.
struct Footing {
  const SettledWheel* wheel = nullptr;
  double length = 0;           ///< of its leg [m]
  double pull = 0, press = 0;  ///< gravity down the plane and into it [m/s^2]
  double friction = 0;         ///< mu
  int way = 0;                 ///< of the slip: 1 down the plane, -1 up, 0: the foot sticks

  /// Finds the series of order 16 by recurrence; some 1 to 2 us.
  FootMotion from(const FootState& state) const;
};

/// Holds the contact at one moment: forces per unit mass [m/s^2] and `stiffness` as in FootMotion.
struct FootForces {
  double normal = 0, tangential = 0, stiffness = 0;
};
FootForces foot_forces(const Footing& footing, double angle, double spin);

}  // namespace metastable::dynamics
