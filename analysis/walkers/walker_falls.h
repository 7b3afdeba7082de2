#pragma once
// How a walker falls: its last steps and the slopes it meets in them, and where in the section it is bound to fall.

#include <vector>

#include "analysis/statistics/last_moments.h"
#include "analysis/walkers/walker_study.h"

namespace metastable::analysis {

/// A node of the mesh.
struct SectionPoint {
  std::vector<double> state;
  std::vector<double> place;  ///< along the principal axes of the noise [stationary sds]
  double regime = 0;          ///< share of the metastable regime
  double last = 0;            ///< share of the walkers whose last step begins here
  double bound_to_fail = 0;   ///< chance of falling before being back within one sd of the gait
};

struct WalkerFalls {
  LastMoments moments;
  std::vector<SectionPoint> section;
  double spacing = 0;  ///< of the nodes [stationary sds]
};

/// The last six steps of a walker that starts in its gait, on the middle one of the study's meshes: states by nodes,
/// slopes by a lattice of scores 0.2 apart. The most likely path goes through nodes; its slopes are those that lead
/// nearest to the next node, and the one nearest to the mean that fails.
/// @throws as study_walker
WalkerFalls how_it_falls(const WalkerSetting& setting, const WalkerStudy& study,
                         const markov::MeshStudyOptions& options);

}  // namespace metastable::analysis
