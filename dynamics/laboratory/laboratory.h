#pragma once
// A virtual laboratory: wheels as they might really be, against which models of them are tested.
//
// Shares no formula with WheelMap or the contact laws: the stance is integrated in time (rolling_motion), the collision
// over its impulse (impulse_collision). The balance of energy over a collision is the paper's: what the impulse does
// not take stays as rotation about the landed foot. Under the law `settled` a second laboratory rolls the wheel as a
// rigid body (rigid_roll), with the same draws of contact, launch and sensor.

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/laboratory/laboratory_changes.h"
#include "dynamics/laboratory/outside_effect.h"
#include "dynamics/laboratory/rolling_motion.h"
#include "dynamics/wheel/contact_law.h"
#include "dynamics/wheel/contact_noise.h"
#include "dynamics/wheel/outcome.h"

namespace metastable::dynamics {

/// A condition has one ramp and one launch.
struct LaboratoryCondition {
  double slope_rad = 0;  ///< stated
  double ramp_length = 3.66;
  double launch_mean = 0, launch_sd = 0;  ///< omega just before collision 1 [rad/s]
  int first_landing_leg = 0;
};

/// Says what is in the laboratory before effects are added.
struct LaboratorySetup {
  Wheel wheel;
  Law law = Law::published;
  double restitution_mean = 0.4, restitution_sd = 0.1;  ///< eta, normal truncated to [0, 1]
  double friction_mean = 0.4, friction_sd = 0.1;        ///< mu, normal truncated to [0, inf)
  /// Skews eta, in (-2, 2): a shifted lognormal of the same mean and sd, cut at 0 and 1, replaces the normal.
  double restitution_skewness = 0;
  double sensor_noise = 0;  ///< of every reported speed [rad/s]
  double smoothing = 0;     ///< reported speeds are means over this time before, or after, the collision [s]
  bool flight = true;       ///< feet may lift
  int max_collisions = 16;
  std::vector<LaboratoryCondition> conditions;
  std::vector<std::size_t> order;  ///< the condition of every trial, in the order they are run
  std::vector<Effect> effects;     ///< each id at most once, but leg_contact and friction_patch
  std::vector<OutsideEffect> outside;
  std::uint64_t seed = 1;
};

struct LaboratoryCollision {
  int leg = 0;
  double time = 0;                               ///< [s] since collision 1
  double position = 0;                           ///< of the landing foot [m], down the ramp from the first
  double omega_minus = 0, omega_plus = 0;        ///< true [rad/s]
  double reported_minus = 0, reported_plus = 0;  ///< as the sensor has them [rad/s], not below 0
  Contact contact;                               ///< eta, mu of this collision, effects included
  bool flew = false;                             ///< the old foot had lifted; `settled`: it did not stand
};

struct LaboratoryTrial {
  std::size_t condition = 0;
  std::vector<LaboratoryCollision> collisions;
  Outcome outcome = Outcome::max_collisions;
  /// The wheel's angle in continuous time, 0 at collision 1 [rad], rising; from at most 0.3 s before it to the next
  /// touch after the last collision, or to where the wheel turns back.
  std::vector<Moment> motion;
};

class Laboratory {
 public:
  /// @throws std::invalid_argument naming what is out of range (setup, effect, or a condition by its index), and under
  ///         `settled` round tips and effects on what a collision loses (bounce, ramp_vibration, stored_energy),
  ///         slip_reversal, sloshing_fluid: a rigid body has none of these; under the other laws soft_contact
  explicit Laboratory(LaboratorySetup setup);

  const LaboratorySetup& setup() const { return setup_; }
  /// Runs trial `index` of the order. Random numbers come from Philox at counter (trial, event): the bits are the same
  /// in any order. A collision takes some 50 us, under `settled` 0.5 ms.
  LaboratoryTrial run(std::size_t index) const;

 private:
  class Roll;
  // About the mass centre, of a rigid wheel that is as stated, or as much heavier to turn about a foot [kg m^2].
  double rigid_inertia() const;
  LaboratorySetup setup_;
  LaboratoryChanges changes_;
  Wheel wheel_;  // as it is
  Law law_;      // that collisions obey
  ContactModel model_;
  std::vector<RollingBody> body_;  // one a condition, as are these
  std::vector<RampSurface> surface_;
  std::vector<TruncatedNormal> launch_;
  TruncatedNormal restitution_, friction_;
};

/// Says where the wheel's angle stands at time t [s] of a trial (cubic Hermite between its moments).
double angle_at(const std::vector<Moment>& motion, double time);

}  // namespace metastable::dynamics
