#pragma once
// Simulates whole trials directly: the independent check of the chain, and made-up experiments.

#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/return_map/launch_speed.h"
#include "dynamics/return_map/wheel_map.h"
#include "dynamics/settled/settled_motion.h"
#include "dynamics/wheel/outcome.h"

namespace metastable::dynamics {

/// Holds one collision of a trial.
struct TrialCollision {
  int number = 0;          ///< from 1
  int leg = 0;             ///< that lands
  double time = 0;         ///< [s] since collision 1
  double position = 0;     ///< of the landing foot, down the ramp from the first [m]
  double omega_minus = 0;  ///< [rad/s]
  double omega_plus = 0;   ///< [rad/s]; 0 if the collision left no energy
  Contact contact;         ///< drawn
  Loss loss;               ///< [J]
};

struct Trial {
  std::vector<TrialCollision> collisions;  ///< the last one is the one that led to rest, if outcome is rest
  Outcome outcome = Outcome::max_collisions;
};

struct TrialOptions {
  int first_landing_leg = 0;
  int max_collisions = 16;    ///< >= 1
  double ramp_length = 3.66;  ///< [m]; infinity: no end. Reached when the last collision on the ramp is survived:
                              ///< the next foot would land beyond it (the 32nd with the paper's legs)
  bool rest_rule = true;      ///< false: never rest, x' < 0 is set to 0 (the reading of Fig. 8)
  std::uint64_t seed = 1;
};

/// Simulates trial `index` of a run: launch speed omega_0 ~ launch and (eta, mu) of each collision
/// come from Philox at counter (index, collision): the same bits whatever ran before and on however many threads.
/// @throws std::invalid_argument for options out of range
Trial simulate_trial(const WheelMap& map, const LaunchSpeed& launch, const TrialOptions& options, std::uint64_t index);

/// Does the same under `settled`: the wheel is rolled event by event, with whatever motion its feet still have when the
/// next leg touches. Before the first collision it stands on a foot with that collision's contact. `loss` is that of
/// the whole landing: in impacts (normal), by friction (tangential), less what the foot's slide downhill gives back
/// (potential); omega_plus is the speed after the first impact; a wheel that chatters on two feet without end counts as
/// one at rest, and the end of the ramp is reached when the next foot touches beyond it.
/// @throws std::invalid_argument for options out of range, and without the rest rule
Trial simulate_trial(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                     const TrialOptions& options, std::uint64_t index);

/// Counts the steps before failure of trial `index` without storing it, at most `limit` (returned when reached).
std::uint64_t steps_to_rest(const WheelMap& map, const LaunchSpeed& launch, int first_landing_leg, std::uint64_t seed,
                            std::uint64_t index, std::uint64_t limit);

std::uint64_t steps_to_rest(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                            int first_landing_leg, std::uint64_t seed, std::uint64_t index, std::uint64_t limit);

/// Says how a trial went that was not stored.
struct RolledOn {
  std::uint64_t steps = 0;
  Outcome outcome = Outcome::max_collisions;  ///< rest, or max_collisions for one followed no further
  bool ran_away = false;                      ///< it was followed no further for its speed
};
/// Does as steps_to_rest() and says whether the last step led to rest; a wheel that spins faster than `fastest` [rad/s]
/// is not followed either. (From a restitution of about 0.8 on, wheels hop down a slope faster and faster.)
RolledOn roll_on(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                 int first_landing_leg, std::uint64_t seed, std::uint64_t index, std::uint64_t limit, double fastest);

/// Returns the number of the last collision on a ramp of that length (foot 1 at 0 m): who survives it reaches the end.
int last_collision_on_ramp(const WheelMap& map, int first_landing_leg, double ramp_length);
/// Does the same from the distances [m] from the foot of each phase to the next one's.
int last_collision_on_ramp(std::span<const double> advance, int first_phase, double ramp_length);

}  // namespace metastable::dynamics
