#pragma once
// Says how a walker falls: its last steps and the slopes it meets in them, and where in the section it must fall.

#include <span>
#include <string>
#include <vector>

#include "analysis/statistics/last_moments.h"
#include "analysis/walkers/walker_study.h"

namespace metastable::analysis {

/// Steps that are told, from the one that fails backwards.
inline constexpr int steps_of_a_fall = 6;

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

/// A noise by its name and unit: mean + sd z at the normal score z.
struct NamedNoise {
  std::string name;
  double mean = 0, sd = 1;
};

/// Describes the last six steps of what starts at `start` (a state at phase 0), on the middle one of the study's
/// meshes: states by nodes, noise by a lattice of scores 0.2 apart (of several scores, 0.6). The most likely path goes
/// through nodes; its noise is that which leads nearest to the next node, and the least that fails. "The gait" is the
/// noise-free orbit; where there is none, half of the metastable regime, what is met most. Phases of a gait of several
/// revolutions are its turns: a step belongs to the turn that it would fall into without noise.
/// @param noises  one for each score
/// @param study  with its orbit and two meshes or more, as mesh_study() gives it
/// @throws std::invalid_argument for another number of noises; as markov::Mesh and markov::mesh_passage
WalkerFalls how_it_falls(const markov::BatchMap& map, std::span<const double> start,
                         const std::vector<NamedNoise>& noises, const markov::MeshStudy& study,
                         const markov::MeshStudyOptions& options);

/// Returns what a walker meets in each step.
std::vector<NamedNoise> noises_of(const WalkerSetting& setting);

/// Does the same for a walker that starts in its gait. @throws as study_walker
WalkerFalls how_it_falls(const WalkerSetting& setting, const WalkerStudy& study,
                         const markov::MeshStudyOptions& options);

}  // namespace metastable::analysis
