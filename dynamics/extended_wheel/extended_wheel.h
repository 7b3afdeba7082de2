#pragma once
// Makes the wheel's step with physical extensions: what each effect of the catalogue does inside the return map.

#include <memory>
#include <optional>
#include <vector>

#include "dynamics/settled/settled_density.h"
#include "dynamics/settled/soft_contact.h"
#include "dynamics/step_density/collision_density.h"
#include "dynamics/wheel/wheel.h"

namespace metastable::dynamics {

/// Holds all that may be added to the model, in five parts; the defaults add nothing. An effect has one field or two,
/// in physical units.
struct Extension {
  /// Changes of the wheel's shape and mass and of the ramp's surface.
  struct Geometry {
    std::vector<double> leg_change;  ///< added to each leg's length [m]; empty: none
    double hub_forward = 0;          ///< centre of mass off the hub, towards leg 0 [m]
    double hub_aside = 0;            ///< the same, a right angle further [m]
    double inertia_ratio = 1;        ///< of the inertia about the foot
    double hub_inertia_ratio = 1;    ///< of J about the hub; `settled`
    double slope_offset_rad = 0;     ///< true minus stated slope [rad]
    enum class Shape { parabola, sine, step };
    Shape sag_shape = Shape::parabola;  ///< of the surface between sag_from and sag_to
    double sag = 0;                     ///< depth in the middle of that stretch [m]
    double sag_from = 0, sag_to = 1;    ///< [m] down the ramp from foot 1
  };
  /// Torques that resist the stance.
  struct Torques {
    double viscous = 0;  ///< by omega [N m s]
    double rolling = 0;  ///< constant [N m]
    double air = 0;      ///< by omega^2 [N m s^2]
  };
  /// Changes of what a foothold is like and of what a collision takes.
  struct ContactChange {
    std::optional<Law> law;                        ///< another contact law
    double restitution_exponent = 0;               ///< p in eta (omega / 5 rad/s)^-p
    double stribeck = 0;                           ///< a in mu (1 + a exp(-omega / stribeck_speed))
    double stribeck_speed = 5;                     ///< [rad/s]
    int leg = -1;                                  ///< the leg with another contact; -1: none
    double leg_friction = 1, leg_restitution = 1;  ///< its ratios
    double patch_from = 0, patch_to = 0;           ///< [m] down the ramp from foot 1
    double patch_friction = 1;                     ///< ratio of mu in the patch
    double drift = 0;                              ///< r in mu (1 + r share of the run gone by)
    double trial_friction_sd = 0;                  ///< of what each trial adds to mu
    double memory = 0;                             ///< correlation of successive collisions of a trial
    double outlier_share = 0;                      ///< probability of a collision with outlier_friction
    double outlier_friction = 1;                   ///< ratio of its mu
    double softness = 0;                           ///< of tips, 1 / sqrt(stiffness) [(m/N)^(1/2)]; `settled`
    double rebound_lost = 0;                       ///< share
    double hops_from = 0;                          ///< omega- from which on it is lost [rad/s]
    double ring_cosine = 0, ring_sine = 0;         ///< loss times 1 + cosine cos(2 pi f dt) + sine sin(2 pi f dt)
    double ring_frequency = 10;                    ///< f [Hz]
  };
  /// Errors of what is reported of a trial: its speeds, and how it is launched.
  struct Sensor {
    double noise_sd = 0;                     ///< of reported speeds, beyond the stated [rad/s]
    double bias_before = 0, bias_after = 0;  ///< of reported omega-, omega+ [rad/s]
    double launch_shift = 0;                 ///< added to the stated mean launch speed [rad/s]
    double launch_widening = 0;              ///< added to its sd [rad/s]
  };
  /// Errors of the law `settled` itself.
  struct LawError {
    double sticking_ratio = 1;  ///< of every mu_c, a little off in engines that move by time steps
    double plus_ratio = 1;      ///< of every omega+, which is seen a little after the impact
    double next_ratio = 1;      ///< of every next omega-
    double next_by_slope = 0;   ///< what the logarithm of next_ratio gains by slope beyond 8 deg [1/rad]
  };

  Geometry geometry;
  Torques torques;
  ContactChange contact;
  Sensor sensor;
  LawError law_error;
};

/// Holds what one collision's place in the experiment tells.
struct StepContext {
  int leg = 0;                                ///< that lands
  double position = 0;                        ///< of its foot, down the ramp from foot 1 [m]
  std::optional<double> since_previous = {};  ///< collision [s]
  double run_share = 0;                       ///< of the run's trials that came before, 0..1
  double friction_shift = 0;                  ///< of this trial, added to mu's mean
  double friction_ratio = 1;                  ///< of this collision's mu
  double friction_scatter = 1;                ///< ratio of the deviation of its mu from the mean
  double restitution_ratio = 1;               ///< of this collision's eta
  double loss_added = 0;                      ///< to the ratio of what this collision loses
};

/// Extends one wheel on one ramp. The stance conserves energy but for the resisting torques, whose work is integrated
/// along the motion slowed by the torque of its start (third order in the torque is neglected).
class ExtendedWheel {
 public:
  /// @param slope  stated slope [rad]
  /// @param landings  of the stated wheel on that slope; needed under `settled` for all that comes after a first impact
  /// @throws std::invalid_argument for `plastic`, and for sds, lengths or slopes out of range
  ExtendedWheel(const Wheel& wheel, double slope, Law law, const ContactSpread& contact, const Extension& extension,
                std::shared_ptr<const LandingShares> landings = {});

  /// Says whether a landing is a motion of its own (`settled`): omega+ is then that after its first impact, and the
  /// next three say the rest.
  bool settles() const { return landings_ != nullptr; }
  /// Says whether omega+ follows from omega- without chance (`plastic`).
  bool certain() const { return model_.law == Law::plastic; }
  /// Finds the next omega-, and the slide where that was seen.
  /// @param blur  sd of its error [rad/s]
  NextTouch at_next_touch(const StepContext& context, double omega, const SeenOfLanding& seen, double blur,
                          double next) const;
  /// Returns P(rest) after a landing at omega [rad/s]. @param omega_plus  after the first impact, where it is known
  double rest_share(const StepContext& context, double omega, std::optional<double> omega_plus) const;
  /// A landing with a drawn contact: the next omega- [rad/s], nothing at rest, and the slide [m].
  struct Drawn {
    std::optional<double> next;
    double displacement = 0;
  };
  Drawn land(const StepContext& context, double omega, const Contact& drawn, bool outlier) const;
  /// Returns the speed up to which the foot of a landing stands before the next one touches [rad/s].
  double settles_below(int leg) const { return landings_->legs[index(leg)].settles_below; }

  /// Gives density of omega+ and probability of less, for a collision at speed omega [rad/s]. Of a certain one the
  /// density is not given.
  SpeedDensity after_collision(const StepContext& context, double omega, double omega_plus) const;
  /// Returns omega+ of that collision with a drawn contact (before the extension's changes) [rad/s]; nothing: no energy
  /// left.
  std::optional<double> omega_plus(const StepContext& context, double omega, const Contact& drawn, bool outlier) const;
  /// Returns the least omega+ that carries the hub over the foot [rad/s].
  double barrier(const StepContext& context) const;
  /// Returns omega just before the next collision [rad/s], by energy; nothing: there is none left. Whether the hub
  /// comes over the foot is barrier()'s to say.
  std::optional<double> next(const StepContext& context, double omega_plus) const;
  /// Returns the omega+ from which the wheel arrives at the next collision with omega_next [rad/s]; nothing: there is
  /// none.
  std::optional<double> back(const StepContext& context, double omega_next) const;
  /// Returns the time of the stance [s], from its speeds.
  double duration(const StepContext& context, double omega_plus) const;
  /// Returns the distance between the landing foot and the next [m].
  double advance(int leg) const {
    return settles() ? landings_->legs[index(leg)].pace : geometry_[index(leg + 1)].triangle.chord;
  }
  int legs() const { return static_cast<int>(geometry_.size()); }

 private:
  struct Leg {
    Triangle triangle;  // of the collision in which it lands
    double length = 0, before = 0, inertia = 0;
    double gyration_sq = 0;  // of its landing; `settled`
    double eccentric_phase = 0;
    double stated_gain = 0, stated_barrier = 0;  // of the stated wheel's stance, of omega^2
    double drag_ratio = 1;     // what resisting torques take off beside what they take off a foot that stands
    double resting_shift = 0;  // what they add to the friction below which the wheel rests
  };
  struct Path {  // of one stance
    double start = 0, end = 0, pendulum = 0, gain = 0, inertia = 0;
  };
  std::size_t index(int leg) const { return static_cast<std::size_t>(leg) % geometry_.size(); }
  Leg leg_of(const Wheel& stated, const Wheel& wheel, std::size_t k) const;
  void hold_against_stated(const ExtendedWheel& stated);
  void read_landings_at_own_inertia();
  double depth(double position) const;
  /// Returns the slope of the line between two footholds [rad].
  double chord_slope(double from, double to) const;
  Path path(const StepContext& context) const;
  double work(const Path& path, double omega_plus_squared) const;
  Collision collision(const StepContext& context, double omega) const;
  CollisionChange change(const StepContext& context, double omega) const;
  Contact changed_contact(const CollisionChange& change, const Contact& drawn, bool outlier) const;
  SettledLanding landing(const StepContext& context, double omega) const;
  SettledContact contact(const CollisionChange& change) const;

  Extension extension_;
  double slope_;
  ContactModel model_;
  ContactSpread contact_;
  std::optional<CollisionDensity> density_;  // none under `plastic`, of which every collision is certain
  std::shared_ptr<const LandingShares> landings_;
  std::optional<SoftContact> soft_;
  double tip_radius_ = 0;
  std::vector<Leg> geometry_;
  bool drag_ = false, profile_ = false;
};

}  // namespace metastable::dynamics
