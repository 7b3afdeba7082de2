#pragma once
// Finds the orbit or walk without noise that the meshes of a study lie around.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "markov/mesh/noise_frame.h"
#include "markov/mesh/other_gaits.h"

namespace metastable::markov {

struct StudyOrbit {
  NoiseFreeOrbit orbit;
  int period = 1;                         ///< MeshStudy::period
  std::uint64_t fails_without_noise = 0;  ///< MeshStudy::fails_without_noise
  int longer_period = 0;                  ///< MeshStudy::longer_period
  std::vector<NoiseFrame> frames;         ///< of the meshes
  GaitOrbit own;                          ///< states of phase 0 of a revolution of the meshes
  int revolutions = 1;                    ///< of the map that are one of the meshes
};

/// Returns the orbit that `start` settles into. @throws as noise_free_orbit()
StudyOrbit orbit_of_start(const BatchMap& map, std::span<const double> start);

/// Returns the periodic gait that the map leads to from right beside `start`, whose own orbit is unstable. One mesh
/// holds all turns of a gait where its nodes reach them; else a revolution of the meshes is all of the gait's. Returns
/// nothing where there is no such gait, or walks that are pushed off it do not come back.
/// @param finest  spacing of the finest meshes  @throws MapError where one mesh would need too many phases
std::optional<StudyOrbit> orbit_of_gait(const BatchMap& map, std::span<const double> start, double finest);

/// Returns the walk from `start`, where that has frames (noise_free_walk()).
std::optional<StudyOrbit> orbit_of_walk(const BatchMap& map, std::span<const double> start);

}  // namespace metastable::markov
