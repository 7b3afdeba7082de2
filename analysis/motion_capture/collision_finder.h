#pragma once
// Finds a wheel's collisions in its angle over time (the paper's Sec. III).

#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/angle_recording.h"
#include "analysis/motion_capture/stance_fit.h"
#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {

struct FinderOptions {
  /// The window of the Savitzky-Golay filter [samples], odd, 5..10001; 0: 50 ms, at least 5 samples, and as many more
  /// as keep the noise's own peaks below `rise`, up to 1.2 of the time of a leg angle at sqrt(g/L).
  int window = 0;
  double rise = 0.4;       ///< of a peak above both sides [rad/s], > 0
  int collisions = 16;     ///< most collisions of a trial, >= 1
  double fit_span = 0.08;  ///< of the stance fit on either side of a collision [s], > 0
  /// @throws std::invalid_argument naming the option and its range
  void validate() const;
};

struct FoundCollision {
  int number = 0;             ///< from 1
  double peak_time = 0;       ///< of the largest smoothed speed [s]
  double peak = 0;            ///< that speed [rad/s]: the paper's omega_minus
  double peak_angle_rad = 0;  ///< of the wheel then
  /// The stance motion fitted to the samples before and after the drop, extrapolated to the collision. Nothing where
  /// samples are too few or the fit did not converge.
  std::optional<StanceFit> fit;
  double apex_time = 0;  ///< of the smallest smoothed speed before the next collision, mid-stance [s]
  double apex = 0;       ///< that speed [rad/s]
  int bounces = 0;       ///< peaks between this collision and the next (or the end)
  /// How far the one frame that the fit leaves out lies off the motion of the others [rad]; 0 where it takes all.
  double stray_rad = 0;
  /// The fit's residual sd where it is more than the noise of the angle [rad]: the speeds are less exact; 0 elsewhere.
  double rough_rad = 0;
  bool flies = false;  ///< the fit's motion behind the collision is a flight
  /// The difference of the fitted omega_minus from the speed that follows from the time since the collision before
  /// [rad/s], where the fit was replaced by that speed and its omega_plus was dropped; 0 where the fit was kept.
  double mended_rad_s = 0;
};

/// Returns what a collisions.csv says of it: the fit, or the peak where there is no fit or `peak` is wanted.
double reported_speed(const FoundCollision& collision, bool peak);  ///< omega_minus [rad/s]
double reported_time(const FoundCollision& collision);              ///< [s]; of the peak where there is no fit

struct FoundTrial {
  std::vector<FoundCollision> collisions;
  /// Says why there are fewer than asked for; empty if there are not.
  std::string stopped;
};

/// Differentiates with a third-degree Savitzky-Golay filter, takes all peaks that rise by `rise` (or six sds of the
/// noise's own speed) above both sides, finds the raster of leg angles on which their falls lie, and takes on each of
/// its angles the fastest peak for the collision; others are bounces. Where the wheel turns on past such an angle and
/// no peak shows, the collision is sought by the fit. Fits that lie off the raster are made anew beside it. Where a
/// fitted speed and the time of the stance before it are not of one motion, the time counts.
/// @param map  wheel and slope, for the stance motion; the contact law matters only through its inertia
/// @param first_landing_leg  that lands at collision 1
/// @throws std::invalid_argument for rates outside 60..1000 Hz or fewer samples than the window; options out of range;
///         collisions that cannot be vouched for, with the time: a landing without a fall of the speed between others,
///         or steps that are no leg angle
FoundTrial find_collisions(const AngleRecording& recording, const dynamics::WheelMap& map, int first_landing_leg,
                           const FinderOptions& options);

/// Returns the window that `options` mean at a sampling rate [Hz], without noise.
int smoothing_window(const FinderOptions& options, double rate);

}  // namespace metastable::analysis
