#pragma once
// Describes the rimless wheel and the ramp it rolls down.

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace metastable::dynamics {

/// Returns the leg lengths of the paper's wheel [m], in the order they land (caption of Fig. 1).
std::vector<double> paper_leg_lengths();

/// Describes a rimless wheel. Defaults are the paper's, in SI units.
struct Wheel {
  /// L_i [m], in the order they land; 3 or more, each > 0 and longer than a neighbour's length times cos alpha: a
  /// shorter one has the hub past it as it lands, or never lands.
  std::vector<double> leg_length = paper_leg_lengths();
  double hub_mass = 1.39;  ///< M [kg], > 0
  /// The inertia about the stance foot, I [kg m^2], > 0. Where it is not given see stance_inertia().
  std::optional<double> inertia;
  /// The radius of gyration about the hub, r_g [m], >= 0. Where it is not given, each law has its own default.
  std::optional<double> radius_of_gyration;
  double tip_radius = 0;               ///< r of the legs' round tips [m], in [0, shortest leg / 20]; `settled` only
  std::optional<double> contact_mass;  ///< m_c [kg] of the Kelvin-Voigt contact (25); default M
  double ramp_stiffness = 9000.0;      ///< K_r [N/m], > 0
  double gravity = 9.81;               ///< g [m/s^2], > 0

  int legs() const { return static_cast<int>(leg_length.size()); }
  /// Returns the angle between neighbouring legs, alpha = 2 pi / legs [rad].
  double leg_angle() const;
  double mean_leg_length() const;
  bool equal_legs() const;
  /// @throws std::invalid_argument naming the quantity, its value and the allowed range.
  void validate() const;
};

/// Describes a collision's geometry: both feet are on the ramp, stance leg `first`, landing leg `second`.
struct Triangle {
  double chord = 0;            ///< c [m], distance between the feet
  double hub_height = 0;       ///< h [m], of the hub over the ramp = y_cp
  double beta_first_rad = 0;   ///< angle of the stance leg to the ramp [rad]
  double beta_second_rad = 0;  ///< angle of the landing leg to the ramp [rad]
  double contact_x = 0;  ///< x_cp [m] = second leg * cos(beta_second_rad), by which the foot lies downhill of the hub
};
/// @param first, second leg lengths [m]; @param leg_angle alpha [rad]
Triangle triangle(double first, double second, double leg_angle);

/// Returns the steepest slope at which a wheel of `legs` legs still has a barrier, alpha / 2 [rad].
double steepest_slope(int legs);

}  // namespace metastable::dynamics
