#include "markov/mesh/study_orbit.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "markov/mesh/node_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::size_t most_phases = 15;  // of a mesh

StudyOrbit around(NoiseFreeOrbit orbit) {
  std::vector<NoiseFrame> frames = orbit.frames;
  GaitOrbit own{frames.front().centre};
  return {.orbit = std::move(orbit), .frames = std::move(frames), .own = std::move(own)};
}

/// Returns nothing where walks that are pushed off the orbit do not come back.
std::optional<NoiseFreeOrbit> orbit_over(const BatchMap& map, const PeriodicGait& gait) {
  try {
    return noise_free_orbit(over_revolutions(map, gait.period), gait.state);
  } catch (const NoOrbit&) {
    return std::nullopt;
  }
}

/// Returns the frames of one mesh that holds all turns of a gait. Those of the last steps' response are as fine as
/// shifts need; in three and four dimensions their nodes fill the memory, and the mean stationary ones are taken.
/// @param frames  stationary, turn by turn
std::vector<NoiseFrame> frames_of_turns(const BatchMap& map, const std::vector<NoiseFrame>& frames,
                                        std::span<const double> on_it) {
  if (map.dimension <= 2)
    if (auto walk = noise_free_walk(map, on_it)) return std::move(walk->frames);
  return common_frames(frames, map.phases);
}

/// Returns whether nodes of a spacing reach as far as some states of phase 0.
bool nodes_reach(const std::vector<NoiseFrame>& frames, const GaitOrbit& states, double spacing) {
  const NodeLattice lattice(frames, spacing, {});
  NodeLattice::Point point{};
  return std::ranges::all_of(states, [&](const auto& state) { return lattice.locate(0, state.data(), point); });
}

}  // namespace

StudyOrbit orbit_of_start(const BatchMap& map, std::span<const double> start) {
  return around(noise_free_orbit(map, start));
}

std::optional<StudyOrbit> orbit_of_gait(const BatchMap& map, std::span<const double> start, double finest) {
  const auto gait = periodic_gait(map, start);
  if (!gait) return std::nullopt;
  auto orbit = orbit_over(map, *gait);
  if (!orbit) return std::nullopt;
  StudyOrbit found = around(std::move(*orbit));
  found.period = gait->period;
  if (gait->period == 1) return found;
  GaitOrbit turns;
  for (std::size_t k = 0; k < found.frames.size(); k += static_cast<std::size_t>(map.phases))
    turns.push_back(found.frames[k].centre);
  std::vector<NoiseFrame> frames = frames_of_turns(map, found.frames, turns.front());
  if (nodes_reach(frames, turns, finest)) {
    found.frames = std::move(frames);
    found.own = std::move(turns);
    return found;
  }
  if (found.frames.size() > most_phases)
    throw MapError(
        fmt::format("return map: its gait of {} revolutions is too wide for the nodes of one mesh", gait->period));
  found.revolutions = gait->period;
  return found;
}

std::optional<StudyOrbit> orbit_of_walk(const BatchMap& map, std::span<const double> start) {
  auto walk = noise_free_walk(map, start);
  if (!walk) return std::nullopt;
  return StudyOrbit{.orbit = {walk->frames, {}},
                    .period = 0,
                    .fails_without_noise = walk->fails_after,
                    .longer_period = walk->fails_after > 0 ? 0 : longer_period(map, start),
                    .frames = walk->frames,
                    .own = {walk->frames.front().centre}};
}

}  // namespace metastable::markov
