#include "markov/splitting/mesh_level.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "markov/mesh/mesh.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/mesh_study.h"
#include "markov/mesh/study_orbit.h"
#include "markov/parallel.h"

namespace metastable::markov {
namespace {

constexpr double usual_spacing = 1;
constexpr int longest_backwards = 200;  // [steps]
constexpr double about_even = 0.2;      // sd over mean of the chances of failing next, among settled walks
constexpr double nearly_settled = 1e-3;

StudyOrbit orbit_around(const BatchMap& map, std::span<const double> start, double spacing) {
  try {
    return orbit_of_start(map, start);
  } catch (const NoOrbit&) {
    if (std::optional<StudyOrbit> gait = orbit_of_gait(map, start, spacing)) return std::move(*gait);
    if (std::optional<StudyOrbit> walk = orbit_of_walk(map, start)) return std::move(*walk);
    throw;
  }
}

/// Says whether settled walks are about equally likely to fail, phase by phase.
bool is_even(const Mesh& mesh, std::span<const double> settled, std::span<const double> chance) {
  const auto phases = static_cast<std::size_t>(mesh.phases());
  std::vector<double> mass(phases, 0), mean(phases, 0), square(phases, 0);
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto p = static_cast<std::size_t>(mesh.phase(i));
    mass[p] += settled[i], mean[p] += settled[i] * chance[i], square[p] += settled[i] * chance[i] * chance[i];
  }
  for (std::size_t p = 0; p < phases; ++p)
    if (!(square[p] * mass[p] <= (1 + about_even * about_even) * mean[p] * mean[p])) return false;
  return true;
}

struct Backwards {
  std::vector<double> chance;  ///< node by node, of failing within the window
  int window = 0;
};

/// Finds the chance of failing within the window after which walks are about equally likely to fail next.
/// @param told  is called after every step backwards
Backwards follow_backwards(const Mesh& mesh, std::span<const double> start, const std::function<void()>& told) {
  const std::vector<double> settled = mesh_passage(mesh, start, nearly_settled, 2000, true).distribution;
  std::vector<double> next(mesh.kill().begin(), mesh.kill().end()), before(mesh.size());
  Backwards found{next, 1};
  for (; found.window < longest_backwards && !is_even(mesh, settled, next); ++found.window) {
    before = next;
    mesh.apply(before, next);
    for (std::size_t i = 0; i < next.size(); ++i) found.chance[i] += next[i];
    told();
  }
  return found;
}

/// Holds a mesh and the logarithms of the chances at its nodes.
struct Held {
  Mesh mesh;
  std::vector<float> logarithm;
  float least = 0;
  int turns = 1;  ///< revolutions of the map that are one of the mesh

  double at(int phase, std::span<const double> state) const {
    double sum = 0, whole = 0;
    const Mesh::Corners corners = mesh.corners(phase, state);
    for (std::size_t c = 0; c < static_cast<std::size_t>(corners.count); ++c) {
      sum += corners.weight[c] * static_cast<double>(logarithm[corners.node[c]]);
      whole += corners.weight[c];
    }
    return whole > 0 ? sum / whole : static_cast<double>(least);
  }
};

/// Returns the map with its rows counted and told, up to most_calls of them.
BatchMap counted_map(const BatchMap& map, std::atomic<std::uint64_t>& calls, std::uint64_t most_calls,
                     const std::function<void()>& told) {
  BatchMap counted = map;
  if (!map.step) return counted;
  counted.step = [&map, &calls, most_calls, told](int phase, auto states, auto scores, auto next, auto failed) {
    if ((calls += failed.size()) > most_calls && most_calls > 0)
      throw NoSplitting(
          fmt::format("splitting: a mesh's level would take more than {:.3g} steps of the map (a learnt level takes "
                      "fewer): no number is given",
                      static_cast<double>(most_calls)));
    map.step(phase, states, scores, next, failed);
    told();
  };
  return counted;
}

std::string of_the_level(const std::exception& error) { return fmt::format("a mesh's level: {}", error.what()); }

/// Grows the mesh, and says of what stands in its way that it is the level's.
std::shared_ptr<Held> grow(const BatchMap& map, std::span<const double> start, const MeshLevelOptions& options) {
  const double spacing = options.spacing > 0 ? options.spacing : usual_spacing;
  try {
    const StudyOrbit around = orbit_around(map, start, spacing);
    const BatchMap walked = around.revolutions == 1 ? map : over_revolutions(map, around.revolutions);
    return std::make_shared<Held>(Held{Mesh(walked, around.frames, start,
                                            {.spacing = spacing,
                                             .seed = options.seed,
                                             .margin = options.margin,
                                             .score_spacing = study_score_spacing(map),
                                             .most_bytes = options.most_bytes}),
                                       {},
                                       0,
                                       around.revolutions});
  } catch (const NoOrbit& error) {
    throw NoOrbit(of_the_level(error));
  } catch (const NoFailureFound& error) {
    throw NoFailureFound(of_the_level(error));
  } catch (const std::length_error& error) {  // too much memory
    throw std::length_error(of_the_level(error));
  }
}

}  // namespace

MeshLevel mesh_level(const BatchMap& map, std::span<const double> start, const MeshLevelOptions& options) {
  require_start(map, start);
  if (map.dimension > most_mesh_dimensions)
    throw TooManyDimensions(
        fmt::format("a mesh's level: the map has {} dimensions, where meshes hold 1 to {}; a learnt "
                    "level takes up to {}",
                    map.dimension, most_mesh_dimensions, most_dimensions));
  std::atomic<std::uint64_t> calls = 0;
  const auto told = one_at_a_time(options.told);
  const std::shared_ptr<Held> held = grow(counted_map(map, calls, options.most_calls, told), start, options);
  const Backwards found = follow_backwards(held->mesh, start, told);
  double least = 1;
  for (const double one : found.chance)
    if (one > 0) least = std::min(least, one);
  held->least = static_cast<float>(std::log(0.1 * least));
  for (const double one : found.chance)
    held->logarithm.push_back(one > 0 ? static_cast<float>(std::log(one)) : held->least);
  MeshLevel answer{{}, found.window, held->mesh.size(), calls};
  answer.level = [held, phases = map.phases, d = static_cast<std::size_t>(map.dimension)](int phase, auto states,
                                                                                          auto levels) {
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const std::span<const double> state = states.subspan(i * d, d);
      double highest = held->at(phase, state);
      for (int turn = 1; turn < held->turns; ++turn)
        highest = std::max(highest, held->at(phase + turn * phases, state));
      levels[i] = highest;
    }
  };
  return answer;
}

}  // namespace metastable::markov
