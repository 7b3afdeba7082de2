#include "analysis/walkers/walker_study.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/walkers/five_link_biped.h"
#include "markov/mesh/noise_frame.h"

namespace metastable::analysis {
namespace {

void require_ranges(const WalkerSetting& setting) {
  if (!(setting.slope_deg > 0 && setting.slope_deg < 45))
    throw std::invalid_argument(fmt::format("slope: {:.6g} deg is outside (0, 45) deg", setting.slope_deg));
  if (!(setting.slope_sd_deg > 0 && setting.slope_sd_deg < 45))
    throw std::invalid_argument(
        fmt::format("slope-sd: {:.6g} deg is outside (0, 45) deg (without noise nothing fails)", setting.slope_sd_deg));
}

markov::BatchMap biped_map(const WalkerSetting& setting) {
  if (setting.terrain != dynamics::Terrain::fresh)
    throw std::invalid_argument("terrain: the biped walks on a plane that tilts anew at every step (fresh) only");
  markov::BatchMap batch;
  batch.dimension = dynamics::FiveLinkBiped::dimension;
  batch.names = dynamics::FiveLinkBiped::names();
  const double slope = setting.slope_deg * degree, sd = setting.slope_sd_deg * degree;
  batch.step = [biped = dynamics::FiveLinkBiped(), slope, sd](int, auto states, auto scores, auto next, auto failed) {
    std::vector<double> slopes;
    for (const double score : scores) slopes.push_back(slope + sd * score);
    biped.step(states, slopes, next, failed);
  };
  batch.inside = [](int, auto state) { return dynamics::FiveLinkBiped::inside(state); };
  return batch;
}

}  // namespace

const char* terrain_name(dynamics::Terrain terrain) { return terrain == dynamics::Terrain::fresh ? "fresh" : "facets"; }

const char* walker_name(Walker walker) {
  switch (walker) {
    case Walker::simplest:
      return "simplest";
    case Walker::compass:
      return "compass";
    case Walker::biped:
      return "biped";
  }
  return "";
}

double walker_slope_deg(Walker walker) {
  constexpr double garcia_slope_deg = 0.5156620156177409;  // 0.009 rad
  return walker == Walker::simplest ? garcia_slope_deg : walker == Walker::compass ? 3 : 1;
}

Walker walker_from_name(const std::string& name) {
  for (const Walker walker : {Walker::simplest, Walker::compass, Walker::biped})
    if (name == walker_name(walker)) return walker;
  throw std::invalid_argument(fmt::format("walker: '{}' is none of simplest, compass, biped", name));
}

dynamics::Terrain terrain_from_name(const std::string& name) {
  for (const dynamics::Terrain terrain : {dynamics::Terrain::fresh, dynamics::Terrain::facets})
    if (name == terrain_name(terrain)) return terrain;
  throw std::invalid_argument(fmt::format("terrain: '{}' is none of fresh, facets", name));
}

dynamics::WalkerMap WalkerSetting::map() const {
  require_ranges(*this);
  if (walker == Walker::biped)
    throw markov::TooManyDimensions(
        fmt::format("walker: the biped has {} dimensions, where meshes hold 1 to {}; steps --method splitting takes it",
                    dynamics::FiveLinkBiped::dimension, markov::most_mesh_dimensions));
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

markov::BatchMap batch_map(const WalkerSetting& setting) {
  if (setting.walker != Walker::biped) return batch_map(setting.map());
  require_ranges(setting);
  return biped_map(setting);
}

std::vector<double> start_state(const WalkerSetting& setting) {
  const double slope = setting.slope_deg * degree;
  if (setting.walker == Walker::biped) return dynamics::FiveLinkBiped().gait(slope);
  return gait_state(setting, dynamics::find_gait(setting.map().walker(), slope));
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
  const markov::BatchMap map = batch_map(setting);
  return markov::splitting_study(map, start_state(setting), options);
}

}  // namespace metastable::analysis
