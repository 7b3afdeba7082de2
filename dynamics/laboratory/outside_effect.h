#pragma once
// Lists laboratory effects that no catalogue holds, so that a diagnosis can be asked about what it does not know.
// They stay out of effect_catalogue() for good.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace metastable::dynamics {

/// Says where a collision stands, as far as these effects ask.
struct OutsidePlace {
  int leg = 0;          ///< that lands
  double position = 0;  ///< of its foot, down the ramp from foot 1 [m]
  double speed = 0;     ///< omega- [rad/s]
  double slowed = 0;    ///< omega- of the collision before, less this one's [rad/s]; 0 at the first
  double clock = 0;     ///< since collision 1 [s]
  bool first = true;    ///< of its trial
  std::size_t trial = 0, trials = 1, condition = 0, conditions = 1;
  double phase = 0;  ///< drawn by the trial, [0, 2 pi)
};

/// Says what becomes of the contact drawn for a collision: mu, its deviation from the mean, eta.
struct OutsideRatios {
  double friction = 1, scatter = 1, restitution = 1;
};

/// One parameter sets the size, neutral at 0; the others are constants of the family.
struct OutsideInfo {
  std::string id;
  std::string summary;
  double upper = 1;  ///< largest size the laboratory takes
  /// What a size makes of a contact; null for what acts on the body or by what was drawn before.
  void (*change)(double size, const OutsidePlace& at, OutsideRatios& ratios) = nullptr;
};

/// sloshing_fluid   a fluid in the hub keeps its spin through collisions and drags on the wheel afterwards; size: its
///                  inertia over the wheel's (coupling time 0.15 s)
/// planks           friction undulates along the ramp every 0.31 m: mu (1 + size cos(2 pi s / 0.31 m))
/// frame_resonance  restitution dips in a band of speeds: eta (1 - size exp(-((omega - 5.3)/0.35)^2)), omega in rad/s
/// stored_energy    a share `size` of what a collision lost beyond the trial's mean loss comes back at the next one
/// speed_spread     contact noise grows with speed: the deviation of mu from its mean times (omega / 5 rad/s)^(8 size)
/// double_plate     legs sit on two plates in turn: mu of odd legs times 1 + size, of even legs times 1 - size
/// warming_feet     mu (1 - size (1 - exp(-t / 1 s))), t since collision 1
/// two_crews        mu of odd trials times 1 + size, of even trials times 1 - size
/// loose_feet       the deviation of mu from its mean times 1 + size on legs 2 and 5
/// second_memory    scores of eta and mu correlate with those of the last collision but one, by `size`
/// crosswind        a torque on the stance, drawn for each trial: N(0, (size N m)^2)
/// wet_day          mu times 1 + size in the last condition; nothing where there is one
/// daily_cycle      mu (1 + size sin(2 pi 2 k / n)), trial k of n
/// hysteresis       mu (1 + size (omega at the last collision - omega) / (1 rad/s))
/// wearing_leg      mu of leg 3 times 1 + size (1 - 2 k / n), trial k of n
/// rough_stretch    the deviation of mu from its mean times 1 + size from 0.5 to 1 m
/// sticky_start     mu times 1 + size at collision 1
/// swaying_floor    mu (1 + size cos(2 pi 0.8 Hz t + phase)), t since collision 1, phase uniform by trial
///
/// Of the last twelve, the diagnosis was set up on the first six; the others are kept for reports.
const std::vector<OutsideInfo>& outside_effects();
/// @throws std::invalid_argument naming the id and all known ones
const OutsideInfo& outside_info(std::string_view id);

struct OutsideEffect {
  std::string id;
  double size = 0;  ///< in [0, upper]
};

}  // namespace metastable::dynamics
