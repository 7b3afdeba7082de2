#pragma once
// The settings and seeds that a coverage program is asked for, and walkers as settings.

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <utility>
#include <vector>

#include "analysis/walkers/walker_study.h"

namespace metastable {

/// [seeds] [first setting] [settings] [first seed]
struct Asked {
  int seeds, first_seed;
  std::size_t first, last;  ///< settings first .. last - 1
};
inline Asked asked(int argc, char** argv, int usual_seeds, std::size_t settings) {
  const auto number = [&](int at, int usual) { return argc > at ? std::atoi(argv[at]) : usual; };
  const auto first = static_cast<std::size_t>(number(2, 0));
  return {number(1, usual_seeds), number(4, 1), first,
          argc > 3 ? std::min(settings, first + static_cast<std::size_t>(number(3, 0))) : settings};
}

/// Returns a walker's map on its own slope, and its gait.
inline std::pair<markov::BatchMap, std::vector<double>> walker_in_gait(analysis::Walker kind, double sd_deg,
                                                                       dynamics::Terrain terrain) {
  const analysis::WalkerSetting setting{kind, analysis::walker_slope_deg(kind), sd_deg, terrain};
  const dynamics::WalkerMap map = setting.map();
  return {analysis::batch_map(map),
          analysis::gait_state(setting, dynamics::find_gait(map.walker(), setting.slope_deg * analysis::degree))};
}

}  // namespace metastable
