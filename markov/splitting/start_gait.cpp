#include "markov/splitting/start_gait.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr int to_the_gait = 300;         // revolutions
constexpr std::size_t most_turns = 256;  // of an orbit
constexpr std::size_t hot_walks = 128;
constexpr int hot_steps = 128, kept_every = 8;
constexpr double hottest = 8;  // sds: no score is larger
constexpr std::uint64_t hot_stream = 0x10000;
constexpr double near_share = 0.5, same_turn = 1e-6,
                 aside = 1e-6;  // of the scale; an orbit that is the start may be unstable

}  // namespace

StartGait::StartGait(const BatchMap& map, std::span<const double> start, std::vector<double> scale)
    : map_(map), scale_(std::move(scale)) {
  if (map.scores == 0) return;
  std::vector<double> state(start.begin(), start.end());
  for (std::size_t k = 0; k < state.size(); ++k) state[k] += aside * scale_[k];
  std::vector<std::size_t> which{0};
  for (int r = 0; r < to_the_gait && !which.empty(); ++r) revolve(state, which);
  for (std::size_t turn = 0; turn < most_turns && !which.empty(); ++turn) {
    double off = 0;
    for (std::size_t k = 0; k < state.size() && turn > 0; ++k)
      off = std::max(off, std::abs(state[k] - orbit_[k]) / scale_[k]);
    if (turn > 0 && off < same_turn) return;
    orbit_.insert(orbit_.end(), state.begin(), state.end());
    revolve(state, which);
  }
  if (which.empty()) orbit_.clear();
}

bool StartGait::near(const double* state) const {
  const std::size_t d = scale_.size();
  for (std::size_t at = 0; at < orbit_.size(); at += d) {
    double squared = 0;
    for (std::size_t k = 0; k < d; ++k) squared += std::pow((state[k] - orbit_[at + k]) / scale_[k], 2);
    if (squared < near_share * near_share) return true;
  }
  return false;
}

/// Takes states through all phases; those that fail, or lead where the map is not defined, are dropped.
/// @param draw  writes the scores of a state by its place among `which`; empty: there is no noise
void StartGait::revolve(std::vector<double>& states, std::vector<std::size_t>& which,
                        const std::function<void(std::size_t place, int phase, std::span<double> scores)>& draw) {
  const std::size_t d = scale_.size(), s = static_cast<std::size_t>(map_.scores);
  std::vector<double> next;
  std::vector<std::uint8_t> failed;
  for (int phase = 0; phase < map_.phases && !which.empty(); ++phase) {
    std::vector<double> scores(which.size() * s, 0.0);
    for (std::size_t i = 0; draw && i < which.size(); ++i) draw(which[i], phase, std::span(scores).subspan(i * s, s));
    next.assign(states.size(), 0.0);
    failed.assign(which.size(), 0);
    map_.step(phase, states, scores, next, failed);
    calls_ += which.size();
    std::size_t left = 0;
    for (std::size_t i = 0; i < which.size(); ++i) {
      if (failed[i] || !is_landing(map_, (phase + 1) % map_.phases, std::span(next).subspan(i * d, d))) continue;
      which[left] = which[i];
      std::copy_n(&next[i * d], d, &states[left++ * d]);
    }
    which.resize(left), states.resize(left * d);
  }
}

std::vector<double> StartGait::heated(std::span<const double> start, double heat, std::uint64_t seed) {
  const int revolutions = std::max(kept_every, hot_steps / map_.phases);
  std::vector<double> states, met;
  std::vector<std::size_t> which;
  for (int r = 0; r < revolutions; ++r) {
    std::vector<std::uint8_t> walks(hot_walks, 0);
    for (const std::size_t walk : which) walks[walk] = 1;
    for (std::size_t walk = 0; walk < hot_walks; ++walk) {
      if (walks[walk]) continue;
      which.push_back(walk);
      states.insert(states.end(), start.begin(), start.end());
    }
    revolve(states, which, [&](std::size_t walk, int phase, std::span<double> scores) {
      const auto number = static_cast<std::uint64_t>(r * map_.phases + phase);
      for (std::size_t k = 0; k < scores.size(); ++k)
        scores[k] = std::clamp(heat * normal_score(uniforms(seed, hot_stream, walk * scores.size() + k, number)[0]),
                               -hottest, hottest);
    });
    if (r % kept_every == kept_every - 1) met.insert(met.end(), states.begin(), states.end());
  }
  return met;
}

std::vector<std::uint8_t> StartGait::left(std::span<const double> states) {
  const std::size_t d = scale_.size(), n = states.size() / d;
  std::vector<double> at(states.begin(), states.end());
  std::vector<std::size_t> which(n);
  std::iota(which.begin(), which.end(), std::size_t{0});
  for (int r = 0; r <= to_the_gait && !which.empty(); ++r) {
    std::size_t away = 0;
    for (std::size_t i = 0; i < which.size(); ++i) {
      if (near(&at[i * d])) continue;
      which[away] = which[i];
      std::copy_n(&at[i * d], d, &at[away++ * d]);
    }
    which.resize(away), at.resize(away * d);
    if (!which.empty() && r < to_the_gait) revolve(at, which);
  }
  if (elsewhere_.empty() && !which.empty()) elsewhere_.assign(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(d));
  std::vector<std::uint8_t> found(n, 0);
  for (const std::size_t i : which) found[i] = 1;
  return found;
}

}  // namespace metastable::markov
