#pragma once
// Says what the quantities of a wheel, its ramp, its contacts and its motion may be.

#include <limits>
#include <string>

#include "dynamics/wheel/wheel.h"

namespace metastable::dynamics {

enum class Law;

/// Holds the values that a quantity may have.
struct Range {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  bool low_open = false, high_open = false;  ///< an infinite end is always open
  /// Holds for finite values only.
  bool holds(double value) const;
  std::string text() const;  ///< "[0.001, 100]", "(0, inf)"
};

/// This is the one table behind options, their help, and the files of an experiment: wide enough for any wheel that can
/// be built, and narrow enough that no square or product of them leaves the doubles.
namespace range {
inline constexpr Range leg_length{.low = 0.001, .high = 100};       ///< [m]
inline constexpr Range mass{.low = 1e-6, .high = 1e6};              ///< of the hub or the contact [kg]
inline constexpr Range inertia{.low = 0, .low_open = true};         ///< about a foot [kg m^2]; and inertia_objection()
inline constexpr Range radius_of_gyration{.low = 0, .high = 1000};  ///< [m]; and gyration_objection()
inline constexpr Range tip_radius{.low = 0, .high = 5};             ///< [m]; and tip_objection()
inline constexpr Range ramp_stiffness{.low = 1, .high = 1e12};      ///< [N/m]
inline constexpr Range gravity{.low = 0.001, .high = 1000};         ///< [m/s^2]
inline constexpr Range ramp_length{.low = 0.001, .high = 100000};   ///< [m]
inline constexpr Range speed{.low = 0, .high = 1000};               ///< of a wheel, mean or sd [rad/s]
inline constexpr Range restitution{.low = 0, .high = 1};            ///< mean or sd of eta
inline constexpr Range friction{.low = 0, .high = 10};              ///< mean or sd of mu
inline constexpr Range rotor_inertia{.low = 1e-12, .high = 1e12};   ///< [kg m^2]
inline constexpr Range rotor_speed{.low = 0, .high = 100000};       ///< [rad/s]
inline constexpr Range loss{.low = -1e9, .high = 1e9};              ///< coefficients of a rotor's loss
inline constexpr Range loss_noise{.low = 0, .high = 1e9};           ///< [rad^2/s^2]
inline constexpr Range run_to_run{.low = 0, .high = 0.5};           ///< of a rotor's loss, a share
inline constexpr Range log{.low = 0, .high = 1e15};                 ///< anything in a counter's log
inline constexpr Range rate{.low = 0.001, .high = 1e7};             ///< of a sensor [Hz]
inline constexpr Range time{.low = -1e10, .high = 1e10};            ///< by whatever clock [s]
inline constexpr Range position{.low = -1e6, .high = 1e6};          ///< [m]
inline constexpr Range turned{.low = -1e9, .high = 1e9};            ///< unwrapped angle [rad]
}  // namespace range

/// Returns the slopes of a wheel of `legs` legs: from 0.001 deg to half the angle between legs, left out [deg].
Range slope_range(int legs);

/// Says why the wheel's inertia about the stance foot is none, "" if nothing is wrong with it or it is not given: it is
/// at least M (mean L)^2, that of the hub's mass alone, and its r_g at most three mean legs.
std::string inertia_objection(const Wheel& wheel);
/// Says it of the radius of gyration: at most three mean legs, and under `settled` above 0.
std::string gyration_objection(const Wheel& wheel, Law law);
/// Says it of the tips' radius: in [0, shortest leg / 20].
std::string tip_objection(const Wheel& wheel);

}  // namespace metastable::dynamics
