#pragma once
// Fits one collision to angle samples: the stance motions before and after it are joined at a kink.

#include <optional>
#include <span>
#include <vector>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {

struct StanceFit {
  double time = 0;             ///< of the collision [s]
  double angle_rad = 0;        ///< of the wheel then
  double omega_minus = 0;      ///< [rad/s]
  double omega_plus = 0;       ///< [rad/s]
  double residual_sd_rad = 0;  ///< of the samples
  double omega_minus_se = 0;   ///< standard error of omega_minus, from what the fit leaves [rad/s]
};

/// Says what the wheel does behind a collision, as far as its samples are taken.
enum class AfterCollision {
  stands,  ///< turns about the landed foot
  flies    ///< the foot hops: nothing changes the spin
};

/// The wheel's angle at a collision as the other collisions of its trial have it.
struct KnownAngle {
  double angle_rad = 0;
  double weight = 0;  ///< of its residual beside those of the samples
};

/// Returns the samples less the motion that a fit describes [rad], one each.
std::vector<double> fit_residuals(std::span<const double> time, std::span<const double> angle,
                                  const dynamics::Stance& before, const dynamics::Stance& after, const StanceFit& fit,
                                  AfterCollision then = AfterCollision::stands);

/// Fits by least squares time, angle, omega_minus and omega_plus: before the collision the stance motion of `before`
/// backwards from its end, after it that of `after` onwards from its start, or a flight; a wheel that falls back lies
/// still on both feet (omega_plus is 0 where it never left them). Levenberg-Marquardt from `guess` and from small
/// omega_plus, the best of them; nothing if fewer than three samples lie on either side, the time leaves the samples,
/// or it does not settle within 50 steps.
/// @param known  holds the collision near an angle where the samples alone leave it open
/// @param time, angle  samples around one collision and no other [s], [rad]
std::optional<StanceFit> fit_collision(std::span<const double> time, std::span<const double> angle,
                                       const dynamics::Stance& before, const dynamics::Stance& after, StanceFit guess,
                                       AfterCollision then = AfterCollision::stands,
                                       std::optional<KnownAngle> known = {});

}  // namespace metastable::analysis
