#pragma once
// Explores a return map with an ensemble until failures are found, and learns what to split by.

#include <cstdint>
#include <functional>
#include <span>

#include "markov/mesh/batch_map.h"
#include "markov/splitting/weighted_ensemble.h"

namespace metastable::markov {

/// The share of a state's memory that is left after the mixing time.
inline constexpr double left_of_memory = 0.05;

/// The steps that are left to expect, a walk at the start, below which they do not count: the share of the walks that
/// are left over the share of them that fails in a step.
inline constexpr double hardly_any = 1e-6;

struct PilotOptions {
  LevelFunction level = {};  ///< to split by; empty: the distance from what is visited, then what is learnt
  bool always = false;       ///< splits by a level that is given even where replicas fail often
  std::size_t replicas = 1000;
  std::uint64_t most_calls = 10000000;
  std::uint64_t seed = 1, stream = 0;
  std::function<void()> told = {};  ///< called after every step; may throw to stop
};

struct LevelPilot {
  Levels levels;          ///< empty where failures are so frequent that nothing is to be split
  bool all_fail = false;  ///< hardly_any steps were left to expect after 64, or no walk after some: there is no regime
  double mixing_steps =
      0;  ///< after which left_of_memory is left of what is remembered of a state, by a regression of ranks
  std::uint64_t window = 0;  ///< [steps] 1.5 mixing times; of a level that is learnt also as many as a failure takes
  std::uint64_t calls = 0;
};

/// Lets an ensemble spread, first by its distance from where it mostly is, until replicas fail; then learns from what
/// it visited the chance of failing within 1.5 mixing times (learn_level), spreads it by that, and learns again, three
/// times in all. Where replicas fail in 0.003 of all steps and more it learns nothing, and splits nothing unless asked.
/// @throws NoSplitting where no replica fails within most_calls; MapError as WeightedEnsemble
LevelPilot level_pilot(const BatchMap& map, std::span<const double> start, const PilotOptions& options);

}  // namespace metastable::markov
