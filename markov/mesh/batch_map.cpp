#include "markov/mesh/batch_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace metastable::markov {

void require_map(const BatchMap& map) {
  if (map.dimension < 1 || map.dimension > most_dimensions)
    throw std::invalid_argument(
        fmt::format("return map: {} dimensions, 1 to {} expected", map.dimension, most_dimensions));
  if (map.phases < 1) throw std::invalid_argument(fmt::format("return map: {} phases, 1 or more expected", map.phases));
  if (map.scores < 0 || (map.scores > 0 && !map.step) || (map.scores == 0 && !map.draw))
    throw std::invalid_argument(
        "return map: either `step` with one score or more, or `draw` with none (the map draws for itself)");
  if (!map.names.empty() && map.names.size() != static_cast<std::size_t>(map.dimension))
    throw std::invalid_argument("return map: one name for each dimension expected");
}

void require_start(const BatchMap& map, std::span<const double> start) {
  require_map(map);
  if (start.size() != static_cast<std::size_t>(map.dimension))
    throw std::invalid_argument(fmt::format("return map: a start of {} numbers expected", map.dimension));
}

BatchMap with_angles(BatchMap map, const std::vector<int>& angles, std::span<const double> around) {
  require_start(map, around);
  const auto dimension = static_cast<std::size_t>(map.dimension);
  std::vector<std::pair<std::size_t, double>> turned;  // place, and the angle that its landings are near
  for (const int place : angles) {
    if (place < 0 || place >= map.dimension)
      throw std::invalid_argument(fmt::format("angles: {} is outside 0..{}", place, map.dimension - 1));
    turned.emplace_back(place, around[static_cast<std::size_t>(place)]);
  }
  if (turned.empty()) return map;
  constexpr double turn = 2 * std::numbers::pi;
  const auto seen = [turned, dimension](std::span<const double> states) {
    std::vector<double> wrapped(states.begin(), states.end());
    for (std::size_t row = 0; row < wrapped.size(); row += dimension)
      for (const auto& [place, near] : turned) wrapped[row + place] = std::remainder(wrapped[row + place], turn);
    return wrapped;
  };
  const auto count = [turned, dimension](std::span<double> next) {
    for (std::size_t row = 0; row < next.size(); row += dimension)
      for (const auto& [place, near] : turned)
        next[row + place] = near + std::remainder(next[row + place] - near, turn);
  };
  if (map.step)
    map.step = [step = map.step, seen, count](int phase, auto states, auto scores, auto next, auto failed) {
      step(phase, seen(states), scores, next, failed);
      count(next);
    };
  if (map.draw)
    map.draw = [draw = map.draw, seen, count](int phase, auto states, auto words, auto next, auto failed) {
      draw(phase, seen(states), words, next, failed);
      count(next);
    };
  if (map.inside)
    map.inside = [inside = map.inside, seen](int phase, auto state) { return inside(phase, seen(state)); };
  return map;
}

std::string describe_state(const BatchMap& map, std::span<const double> state) {
  std::string text;
  for (std::size_t k = 0; k < state.size(); ++k) {
    const std::string name = map.names.empty() ? fmt::format("x{}", k + 1) : map.names[k];
    text += fmt::format("{}{} = {:.9g}", k ? ", " : "", name, state[k]);
  }
  return text;
}

namespace {

bool all_finite(std::span<const double> landing) {
  return std::all_of(landing.begin(), landing.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

bool is_landing(const BatchMap& map, int phase, std::span<const double> state) {
  return all_finite(state) && (!map.inside || map.inside(phase, state));
}

void require_landings(const BatchMap& map, int phase, std::span<const double> states, std::span<const double> next,
                      std::span<const std::uint8_t> failed) {
  const auto dimension = static_cast<std::size_t>(map.dimension);
  const int landing_phase = (phase + 1) % map.phases;
  for (std::size_t i = 0; i < failed.size(); ++i) {
    if (failed[i]) continue;
    const auto landing = next.subspan(i * dimension, dimension);
    if (is_landing(map, landing_phase, landing)) continue;
    throw MapError(fmt::format("return map: from the state {} (phase {}) it leads to {}, which is {}",
                               describe_state(map, states.subspan(i * dimension, dimension)), phase,
                               describe_state(map, landing),
                               all_finite(landing) ? "outside its own section" : "not finite"));
  }
}

void checked_step(const BatchMap& map, int phase, std::span<const double> states, std::span<const double> scores,
                  std::span<double> next, std::span<std::uint8_t> failed) {
  map.step(phase, states, scores, next, failed);
  require_landings(map, phase, states, next, failed);
}

void checked_draw(const BatchMap& map, int phase, std::span<const double> states, std::span<const std::uint64_t> words,
                  std::span<double> next, std::span<std::uint8_t> failed) {
  map.draw(phase, states, words, next, failed);
  require_landings(map, phase, states, next, failed);
}

}  // namespace metastable::markov
