#include "dynamics/laboratory/outside_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <ranges>
#include <stdexcept>

namespace metastable::dynamics {

const std::vector<OutsideInfo>& outside_effects() {
  static const std::vector<OutsideInfo> all{
      {"sloshing_fluid", "a fluid in the hub keeps its spin through collisions", 1},
      {"planks", "friction undulates along the ramp", 0.9},
      {"frame_resonance", "restitution dips in a band of speeds", 0.95},
      {"stored_energy", "part of one collision's loss comes back at the next", 0.9},
      {"speed_spread", "contact noise grows with speed", 1},
      {"double_plate", "odd and even legs differ in friction", 0.6},
      {"warming_feet", "friction falls as a trial goes on, by the clock", 0.27},
      {"two_crews", "every other trial has another friction", 0.075},
      {"loose_feet", "the contact of two legs scatters more", 1.2},
      {"second_memory", "collisions remember the last but one", 0.6},
      {"crosswind", "each trial has a torque of its own", 0.003},
      {"wet_day", "friction differs in the last condition", 0.16},
      {"daily_cycle", "friction rises and falls over the trials", 0.1},
      {"hysteresis", "friction depends on the change of speed since the last collision", 0.3},
      {"wearing_leg", "one leg's friction falls over the trials", 0.36},
      {"rough_stretch", "contact scatters more on a stretch of the ramp", 1.2},
      {"sticky_start", "friction differs at the first collision", 0.3},
      {"swaying_floor", "friction swings with the clock, from a phase that each trial draws", 0.13},
  };
  return all;
}

const OutsideInfo& outside_info(std::string_view id) {
  const auto& all = outside_effects();
  const auto found = std::find_if(all.begin(), all.end(), [id](const OutsideInfo& info) { return info.id == id; });
  if (found != all.end()) return *found;
  throw std::invalid_argument(fmt::format("outside effect: \"{}\" is none of {}", id,
                                          fmt::join(all | std::views::transform(&OutsideInfo::id), ", ")));
}

}  // namespace metastable::dynamics
