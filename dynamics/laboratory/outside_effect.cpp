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
