#pragma once
// Lists ways in which a wheel's contacts may vary that no effect of the catalogue has. They are fitted as effects are
// and never named as causes: they stand for what has no name.

#include <cstddef>
#include <functional>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/wheel_runs.h"
#include "dynamics/extended_wheel/extended_wheel.h"

namespace metastable::analysis {

/// Says where a collision stands in its experiment.
struct CollisionPlace {
  std::size_t trial = 0, condition = 0;
  int number = 1;              ///< in its trial, from 1
  double omega = 0;            ///< before it [rad/s]
  double launch = 0;           ///< first speed of the trial [rad/s]
  double gained = 0;           ///< since the collision before, 0 at the first [rad/s]
  double gained_before = 0;    ///< from the last but one to the collision before, 0 at the first two [rad/s]
  double clock = 0;            ///< since the trial's first collision [s]
  dynamics::StepContext step;  ///< as measured
};
/// @param here  the collision that follows `before` of the trial's collisions  @param omega  of it
CollisionPlace collision_place(const WheelRun& run, std::size_t trial, std::size_t before, const RunCollision& here,
                               double omega);

enum class ContactAspect { mean_friction, mean_restitution, scatter_of_friction, loss };

/// Changes an aspect of a step's contact. The amount is added to a loss as it stands, and to the logarithm of any other
/// aspect, in which it counts for 3 at most, because covariates may lie far off.
void vary(dynamics::StepContext& step, ContactAspect aspect, double amount);

/// Says by how much a unit of an effect's parameter changes an aspect of one collision's contact.
struct AspectChange {
  ContactAspect aspect = ContactAspect::mean_friction;
  double amount = 0;
};

/// Holds a variation, and the change of its logarithm at a collision: of the mean of mu or of eta, or of the scatter of
/// mu about its mean.
struct ContactVariation {
  Variation variation;
  ContactAspect aspect = ContactAspect::mean_friction;
  std::function<double(const CollisionPlace&, const std::vector<double>& variant, const std::vector<double>& values)>
      log_ratio;
};

/// Lists them for these runs. Of the means: smooth changes along a trial by the clock, swings over the trials, every
/// other trial, every other leg, one condition, one leg over the trials, the speed of the launch, the first collision,
/// the change of speed since the collision before and how unusual it was, the speed, waves along the ramp. Of the
/// loss: what the two collisions before lost. Of the scatter: by speed, place, order of trials, leg, at the first
/// collision.
std::vector<ContactVariation> contact_variations(const WheelRuns& measured);

}  // namespace metastable::analysis
