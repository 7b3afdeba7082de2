#include "markov/mesh/other_gaits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "markov/mesh/mesh_growth.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::uint64_t hot_stream = 0x8000;
constexpr std::size_t nodes = 1500;    // of the mesh, followed without noise
constexpr std::size_t hot_walks = 64;  // at each of
constexpr double heats[] = {2, 4};     // so many times the noise: what has an action of 60 has one of 15 or 4 there
constexpr int hot_steps = 128, kept_every = 8;
constexpr double hottest = 8;  // sds: no score is larger
constexpr int first_revolutions = 300, more_revolutions = 2000, orbit_length = 32;
constexpr double near_distance = 1;  // stationary sds
constexpr double far_reach = 12;     // scores on meshes of several gaits, some of them left very rarely: 1e-32
constexpr std::size_t most_gaits = 8, most_strays = 64;

using State = std::vector<double>;

class Search {
 public:
  Search(const BatchMap& map, const std::vector<NoiseFrame>& frames)
      : map_(map),
        frames_(frames),
        d_(static_cast<std::size_t>(map.dimension)),
        s_(static_cast<std::size_t>(map.scores)) {}

  /// Returns states of phase 0 that the noise can lead to.
  std::vector<State> seeds(std::span<const double> start, const Mesh& mesh, std::uint64_t seed) const {
    std::vector<State> found;
    const std::size_t every = std::max<std::size_t>(1, mesh.size() / nodes);
    for (std::size_t i = 0; i < mesh.size(); i += every) {
      if (mesh.phase(i) != 0) continue;
      State state = mesh.state(i);
      if (!map_.inside || map_.inside(0, state)) found.push_back(std::move(state));
    }
    walk_hot(start, seed, found);
    return found;
  }

  /// Follows states for so many revolutions without noise; those that fail or come near the gaits are dropped.
  void relax(std::vector<State>& states, int revolutions, const std::vector<GaitOrbit>& gaits) const {
    std::vector<double> scores;
    for (int r = 0; r < revolutions && !states.empty(); ++r) {
      for (int phase = 0; phase < map_.phases; ++phase) {
        scores.assign(states.size() * s_, 0.0);
        step(phase, states, scores);
      }
      std::erase_if(states, [&](const State& state) { return state.empty() || known(state, gaits); });
    }
  }

  bool known(const State& state, const std::vector<GaitOrbit>& gaits) const {
    return std::any_of(gaits.begin(), gaits.end(), [&](const GaitOrbit& orbit) {
      return std::any_of(orbit.begin(), orbit.end(),
                         [&](const State& at) { return distance(state, at) < near_distance; });
    });
  }

  /// Keeps one of those that lie together.
  void thin(std::vector<State>& states) const {
    std::vector<State> kept;
    for (State& state : states) {
      if (kept.size() == most_strays) break;
      if (std::none_of(kept.begin(), kept.end(),
                       [&](const State& k) { return distance(state, k) < near_distance / 2; }))
        kept.push_back(std::move(state));
    }
    states = std::move(kept);
  }

  GaitOrbit orbit(const State& state) const {
    GaitOrbit all{state}, at{state};
    for (int r = 1; r < orbit_length; ++r) {
      relax(at, 1, {});
      if (at.empty() || distance(at.front(), state) < 1e-3) break;
      all.push_back(at.front());
    }
    return all;
  }

 private:
  double distance(const State& a, const State& b) const {
    const NoiseFrame& frame = frames_.front();
    double squared = 0;
    for (std::size_t k = 0; k < d_; ++k) {
      double u = 0;
      for (std::size_t i = 0; i < d_; ++i) u += frame.inverse[k * d_ + i] * (a[i] - b[i]);
      squared += u * u;
    }
    return std::sqrt(squared);
  }

  /// Steps all states; one that fails, or leads where the map is not defined, becomes empty. Such states are not errors
  /// here: no one has promised that they can be walked from.
  void step(int phase, std::vector<State>& states, std::span<const double> scores) const {
    std::vector<double> from, next, some;
    std::vector<std::size_t> walking;
    for (std::size_t i = 0; i < states.size(); ++i) {
      if (states[i].empty()) continue;
      walking.push_back(i);
      from.insert(from.end(), states[i].begin(), states[i].end());
      some.insert(some.end(), scores.begin() + static_cast<std::ptrdiff_t>(i * s_),
                  scores.begin() + static_cast<std::ptrdiff_t>((i + 1) * s_));
    }
    if (walking.empty()) return;
    next.resize(from.size());
    std::vector<std::uint8_t> failed(walking.size(), 0);
    map_.step(phase, from, some, next, failed);
    for (std::size_t n = 0; n < walking.size(); ++n) {
      State& state = states[walking[n]];
      state.assign(next.begin() + static_cast<std::ptrdiff_t>(n * d_),
                   next.begin() + static_cast<std::ptrdiff_t>((n + 1) * d_));
      const bool defined = std::all_of(state.begin(), state.end(), [](double x) { return std::abs(x) < 1e100; }) &&
                           (!map_.inside || map_.inside((phase + 1) % map_.phases, state));
      if (failed[n] || !defined) state.clear();
    }
  }

  /// Adds what the walks come through, those of the least heat first; all walk side by side.
  void walk_hot(std::span<const double> start, std::uint64_t seed, std::vector<State>& found) const {
    const State first(start.begin(), start.end());
    std::vector<State> states(std::size(heats) * hot_walks, first), met[std::size(heats)];
    std::vector<double> scores(states.size() * s_);
    for (int number = 0; number < hot_steps;) {
      for (int phase = 0; phase < map_.phases; ++phase, ++number) {
        for (std::size_t i = 0; i < states.size(); ++i)
          for (std::size_t k = 0; k < s_; ++k) {
            const std::size_t heat = i / hot_walks, walk = i % hot_walks;
            const double u = uniforms(seed, hot_stream + heat, walk * s_ + k, static_cast<std::uint64_t>(number))[0];
            scores[i * s_ + k] = std::clamp(heats[heat] * normal_score(u), -hottest, hottest);
          }
        step(phase, states, scores);
      }
      for (std::size_t i = 0; i < states.size(); ++i) {
        if (!states[i].empty() && number / map_.phases % kept_every == 0) met[i / hot_walks].push_back(states[i]);
        if (states[i].empty()) states[i] = first;  // it begins again, as it would at phase 0
      }
    }
    for (std::vector<State>& some : met) std::move(some.begin(), some.end(), std::back_inserter(found));
  }

  const BatchMap& map_;
  const std::vector<NoiseFrame>& frames_;
  std::size_t d_, s_;
};

/// Grows from one gait until the others and a failure are met. Returns the action of each target.
struct Ways {
  std::vector<double> to;
  double failure = 0;
};

Ways ways_from(const BatchMap& map, const std::vector<NoiseFrame>& frames, const std::vector<GaitOrbit>& gaits,
               std::size_t from, MeshOptions options) {
  for (std::size_t g = 0; g < gaits.size(); ++g)
    if (g != from) options.targets.push_back(gaits[g].front());
  const NodeLattice lattice = mesh_lattice(map, frames, options);
  MeshGrowth growth(map, lattice, options);
  growth.grow_from_state(gaits[from].front());
  Ways ways{{}, growth.cheapest_failure()};
  ways.to = growth.target_actions();
  ways.to.insert(ways.to.begin() + static_cast<std::ptrdiff_t>(from), 0.0);
  return ways;
}

}  // namespace

MeshOptions with_gaits(MeshOptions options, const OtherGaits& gaits) {
  if (gaits.orbits.size() < 2) return options;
  options.score_reach = far_reach;
  options.sources = gaits.sources;
  options.start_action = gaits.start_action;
  options.limit = gaits.limit;
  return options;
}

OtherGaits find_other_gaits(const BatchMap& map, const std::vector<NoiseFrame>& frames, const GaitOrbit& own,
                            std::span<const double> start, const Mesh& mesh, const MeshOptions& options) {
  const Search search(map, frames);
  std::vector<GaitOrbit> orbits{own};
  std::vector<State> strays = search.seeds(start, mesh, options.seed);
  search.relax(strays, first_revolutions, orbits);
  search.thin(strays);
  search.relax(strays, more_revolutions, orbits);
  for (const State& stray : strays) {
    if (search.known(stray, orbits)) continue;
    if (orbits.size() > most_gaits)
      throw MapError(
          fmt::format("return map: it has more than {} other gaits, as at {}", most_gaits, describe_state(map, stray)));
    orbits.push_back(search.orbit(stray));
  }
  if (orbits.size() == 1) return {.orbits = orbits};
  OtherGaits found;
  std::vector<Ways> ways;
  for (std::size_t g = 0; g < orbits.size(); ++g)
    ways.push_back(g == 0 || ways.front().to[g] <= MeshGrowth::farthest ? ways_from(map, frames, orbits, g, options)
                                                                        : Ways{});
  std::vector<double> limit(ways.size(), 0.0);
  std::vector<GaitOrbit> reached;
  for (std::size_t g = 0; g < ways.size(); ++g) {
    if (!(ways.front().to[g] <= MeshGrowth::farthest)) continue;  // the noise does not lead there
    for (std::size_t h = 0; h < ways.size(); ++h)
      if (h != g && ways[g].to[h] <= MeshGrowth::farthest) limit[g] = std::max(limit[g], ways[g].to[h]);
    if (ways[g].failure <= MeshGrowth::farthest && (g == 0 || limit[g] == 0 || ways[g].failure < limit[g]))
      limit[g] = std::max(limit[g], ways[g].failure);
    if (limit[g] == 0 && found.trap.empty())
      found.trap = fmt::format(
          "the noise leads within an action of {:.3g} to another gait, at {}, from which neither a failure nor a way "
          "back "
          "is found within an action of {:.3g}",
          ways.front().to[g], describe_state(map, orbits[g].front()), MeshGrowth::farthest);
    limit[g] += options.margin;
    found.limit = std::max(found.limit, limit[g]);
    reached.push_back(orbits[g]);
  }
  if (reached.size() == 1) return {.orbits = reached};
  found.start_action = found.limit - limit.front();
  for (std::size_t g = 1; g < ways.size(); ++g)
    if (limit[g] > 0)
      for (const State& at : orbits[g]) found.sources.push_back({at, found.limit - limit[g]});
  found.orbits = std::move(reached);
  return found;
}

}  // namespace metastable::markov
