#include "analysis/walkers/walker_study.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::analysis {

const char* terrain_name(dynamics::Terrain terrain) { return terrain == dynamics::Terrain::fresh ? "fresh" : "facets"; }

const char* walker_name(Walker walker) { return walker == Walker::simplest ? "simplest" : "compass"; }

double walker_slope_deg(Walker walker) {
  constexpr double garcia_slope_deg = 0.5156620156177409;  // 0.009 rad
  return walker == Walker::simplest ? garcia_slope_deg : 3;
}

Walker walker_from_name(const std::string& name) {
  for (const Walker walker : {Walker::simplest, Walker::compass})
    if (name == walker_name(walker)) return walker;
  throw std::invalid_argument(fmt::format("walker: '{}' is none of simplest, compass", name));
}

dynamics::Terrain terrain_from_name(const std::string& name) {
  for (const dynamics::Terrain terrain : {dynamics::Terrain::fresh, dynamics::Terrain::facets})
    if (name == terrain_name(terrain)) return terrain;
  throw std::invalid_argument(fmt::format("terrain: '{}' is none of fresh, facets", name));
}

dynamics::WalkerMap WalkerSetting::map() const {
  if (!(slope_deg > 0 && slope_deg < 45))
    throw std::invalid_argument(fmt::format("slope: {:.6g} deg is outside (0, 45) deg", slope_deg));
  if (!(slope_sd_deg > 0 && slope_sd_deg < 45))
    throw std::invalid_argument(
        fmt::format("slope-sd: {:.6g} deg is outside (0, 45) deg (without noise nothing fails)", slope_sd_deg));
  return {walker == Walker::simplest ? dynamics::TwoLinkWalker::simplest() : dynamics::TwoLinkWalker::compass(),
          {.slope_rad = slope_deg * degree, .slope_sd_rad = slope_sd_deg * degree, .terrain = terrain}};
}

std::string WalkerSetting::describe() const {
  return fmt::format("walker {}, slope {:.6g} deg, sd {:.6g} deg, terrain {}", walker_name(walker), slope_deg,
                     slope_sd_deg, terrain_name(terrain));
}

markov::BatchMap batch_map(const dynamics::WalkerMap& map) {
  markov::BatchMap batch;
  batch.dimension = map.dimension();
  batch.names = map.names();
  const auto inside = [](std::span<const double> state) { return state[0] > 0 && state[0] < std::numbers::pi / 2; };
  batch.step = [map, inside](int, auto states, auto scores, auto next, auto failed) {
    map.step(states, scores, next, failed);
    const std::size_t d = states.size() / failed.size();
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (!failed[i] && !inside(next.subspan(i * d, d))) failed[i] = 1;
  };
  batch.inside = [inside](int, auto state) { return inside(state); };
  return batch;
}

std::vector<double> gait_state(const WalkerSetting& setting, const dynamics::Gait& gait) {
  std::vector<double> state = gait.state;
  if (setting.terrain == dynamics::Terrain::facets) state.push_back(setting.slope_deg * degree);
  return state;
}

WalkerStudy study_walker(const WalkerSetting& setting, const markov::MeshStudyOptions& options) {
  const dynamics::WalkerMap map = setting.map();
  WalkerStudy study;
  study.gait = dynamics::find_gait(map.walker(), setting.slope_deg * degree);
  study.passage = markov::mesh_study(batch_map(map), gait_state(setting, study.gait), options);
  return study;
}

markov::SplittingStudy split_walker(const WalkerSetting& setting, const markov::SplittingOptions& options) {
  const dynamics::WalkerMap map = setting.map();
  const dynamics::Gait gait = dynamics::find_gait(map.walker(), setting.slope_deg * degree);
  return markov::splitting_study(batch_map(map), gait_state(setting, gait), options);
}

}  // namespace metastable::analysis
