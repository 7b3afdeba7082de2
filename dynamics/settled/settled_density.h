#pragma once
// Describes one landing of the law `settled` with random (eta, mu): densities of the speed after its first impact and
// of the speed at the next touch.

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "dynamics/settled/landing_shares.h"
#include "dynamics/step_density/collision_density.h"

namespace metastable::dynamics {

/// A landing of a wheel that may differ from the grid's own.
struct SettledLanding {
  LandingShares::SharesAtSpeed place;  ///< of the grid, at `omega`
  double omega = 0;                    ///< omega- [rad/s]
  double ahead = 0, height = 0;        ///< of the landing foot: ahead of the centre of mass, below it [m]
  double chord = 0;                    ///< between the feet [m]
  double gyration_sq = 0;              ///< J / M about the centre of mass [m^2]
  double barrier_squared = 0;          ///< [rad^2/s^2]
  double loss_ratio = 1;               ///< multiplies what is lost of omega^2
  // A soft tip changes these three of the first impact (SoftContact).
  double turned = 0;          ///< by the wheel before half of the impulse is given [rad]
  double pressed = 1;         ///< ratio of the normal impulse to a rigid tip's
  double sticking_shift = 0;  ///< added to mu_c beside what the turn does
  /// omega-^2 of the next touch is next_rate omega_eq^2 + next_gain less what resisting torques take: a parabola, whose
  /// coefficients these are, of omega_eq^2 [rad^2/s^2].
  double next_rate = 1, next_gain = 0;
  std::array<double, 3> dragged{};
  double next_ratio = 1;     ///< multiplies the next omega-
  double resting_shift = 0;  ///< added to mu_r, below which the wheel rests; mu_c stays

  /// Returns omega- at the next touch from omega_eq^2 [rad/s]; rising.
  double next(double omega_eq_squared) const {
    const double taken = dragged[0] + omega_eq_squared * (dragged[1] + omega_eq_squared * dragged[2]);
    return next_ratio * std::sqrt(std::max(1e-6, next_rate * omega_eq_squared + next_gain - taken));
  }

  /// Return the place of the landing foot and the distance to the old one as the first impact has them [m].
  double struck_ahead() const { return ahead - height * turned; }
  double struck_height() const { return height + ahead * turned; }
  double struck_chord() const { return chord * pressed; }
  /// Returns mu_c.
  double sticking() const { return sticking_friction(struck_ahead(), struck_height(), gyration_sq) + sticking_shift; }
  /// Returns the part of omega- that the first impact takes at eta = 0 with a friction of at most mu_c.
  double plastic_loss(double friction) const;
  /// Returns the same if the foot sticks.
  double plastic_loss() const { return plastic_loss(sticking()); }
  /// Returns what multiplies the speed lost in a first impact: of that plastic one the energy lost is multiplied by
  /// `loss_ratio`. (A ratio of each impact's energy leaves a gap above omega+ = 0, and beside it ever denser speeds.)
  double first_loss_ratio() const;
  /// Returns omega+ / omega- of the first impact, which starts without slip.
  double first_impact(const Contact& contact) const;
  /// Returns mu_r of the grid moved by `resting_shift`, by so little that it stays below the grid's mu_c.
  double resting(double of_grid) const;
  /// Returns omega_eq^2 [rad^2/s^2] and the slide [m]: the grid's share at the same part of the way from mu_r to mu_c,
  /// moved by what a plastic landing of this wheel keeps more or less than one of the grid's.
  LandingShares::Kept carried(const Contact& contact) const;
  /// Returns the same from what the grid keeps there.
  LandingShares::Kept carried_as(const LandingShares::Kept& of_grid) const;
};

/// Holds mu = ratio N(mean, sd^2), mu >= 0, and eta = N(mean, sd^2) in [0, 1], at one landing; of one in so many other
/// mu.
struct SettledContact {
  double restitution_mean = 0, restitution_sd = 0, friction_mean = 0, friction_sd = 0;
  double rare_share = 0, rare_ratio = 1;  ///< share of landings whose mu is rare_ratio times as large
};

/// Holds what was measured of a landing beside omega- and the next one.
struct SeenOfLanding {
  std::optional<double> omega_plus = {};    ///< after the first impact [rad/s]
  std::optional<double> displacement = {};  ///< slide of the foot [m]
  double displacement_error = 1e-3;         ///< scale of slide_score in what the landing says of it [m], > 0
};

/// Returns the quantile of the error of a slide, in units of its scale: Student's, with three degrees of freedom, as a
/// foot that slides far does so less surely. @param share  in (0, 1)
double slide_score(double share);

/// Returns density and distribution function of omega+ of the first impact. Twelve restitutions, mu in closed form.
SpeedDensity after_first_impact(const SettledLanding& landing, const SettledContact& contact, double omega_plus);

/// Says what a landing says of the next touch.
struct NextTouch {
  SpeedDensity speed;        ///< of the next omega-, given the slide where that was seen; no touch counts as below
  double slide_density = 1;  ///< of the slide given that the next foot touched, where it was seen [1/m]
  double slope = 0;          ///< of the log density of the next omega- [s/rad]
  double curvature = 0;      ///< its second derivative [s^2/rad^2]
};

/// Finds the next omega-, blurred by a normal error. One landing in 500 is taken as one that the law knows little of:
/// its next speed is off by 0.2 rad/s. @param blur [rad/s], > 0
NextTouch at_next_touch(const SettledLanding& landing, const SettledContact& contact, const SeenOfLanding& seen,
                        double blur, double next);
/// Returns P(no next touch).
double rest_share(const SettledLanding& landing, const SettledContact& contact, std::optional<double> omega_plus);

}  // namespace metastable::dynamics
