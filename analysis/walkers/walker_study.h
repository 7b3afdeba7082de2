#pragma once
// Studies a walker on rough ground: its gait, and how many steps it takes before it falls.

#include <numbers>
#include <string>

#include "analysis/statistics/estimate.h"
#include "dynamics/walkers/gait.h"
#include "dynamics/walkers/walker_map.h"
#include "markov/mesh/batch_map.h"
#include "markov/mesh/mesh_study.h"
#include "markov/splitting/splitting_study.h"

namespace metastable::analysis {

/// [rad]
inline constexpr double degree = std::numbers::pi / 180;

enum class Walker { simplest, compass, biped };

struct WalkerSetting {
  Walker walker = Walker::compass;
  double slope_deg = 3;
  double slope_sd_deg = 0.5;  ///< > 0: without noise a walker that has a stable gait never falls
  dynamics::Terrain terrain = dynamics::Terrain::fresh;

  /// @throws std::invalid_argument for a number out of range; markov::TooManyDimensions for the biped
  dynamics::WalkerMap map() const;
  /// Returns one line, for provenance.
  std::string describe() const;
};

/// Returns "simplest", "compass", "biped".
const char* walker_name(Walker walker);
/// Returns the slope of the paper that it comes from, 0.009 rad, 3 deg; of the biped 1 deg.
double walker_slope_deg(Walker walker);
/// Returns "fresh", "facets".
const char* terrain_name(dynamics::Terrain terrain);
/// @throws std::invalid_argument for a name that is none of "simplest", "compass", "biped"; of "fresh", "facets"
Walker walker_from_name(const std::string& name);
dynamics::Terrain terrain_from_name(const std::string& name);

/// Returns the walker's map in batches. States: as WalkerMap's. Section: 0 < half angle < pi/2; a
/// step that leads out of it, legs crossed or in line, is a fall.
markov::BatchMap batch_map(const dynamics::WalkerMap& map);
/// Does the same for any walker, the biped of nine numbers (dynamics::FiveLinkBiped) included.
/// @throws std::invalid_argument for a setting out of range, and for a biped on facets
markov::BatchMap batch_map(const WalkerSetting& setting);
/// Returns the state of any walker just after a strike in its gait, as batch_map(setting) takes it.
/// @throws std::domain_error where there is none
std::vector<double> start_state(const WalkerSetting& setting);

struct WalkerStudy {
  dynamics::Gait gait;
  markov::MeshStudy passage;  ///< from the gait; the last slope is the mean
};

/// Returns the state just after a strike in the gait, with the mean slope underfoot where the terrain remembers it.
std::vector<double> gait_state(const WalkerSetting& setting, const dynamics::Gait& gait);

/// @throws std::invalid_argument for a setting out of range; std::domain_error where there is no gait;
///         markov::MapError where it is unstable or no failure is found; as markov::mesh_study
WalkerStudy study_walker(const WalkerSetting& setting, const markov::MeshStudyOptions& options = {});

/// Does the same without a mesh, by splitting.
/// @throws std::invalid_argument for a setting out of range; std::domain_error where there is no gait; as
///         markov::splitting_study
markov::SplittingStudy split_walker(const WalkerSetting& setting, const markov::SplittingOptions& options = {});

}  // namespace metastable::analysis
