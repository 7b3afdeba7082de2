#pragma once
// Simulates any return map directly, many trials at a time.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "markov/mesh/batch_map.h"

namespace metastable::markov {

struct SimulationOptions {
  std::size_t trials = 1000;  ///< >= 2
  std::uint64_t seed = 1;
  int threads = 0;                                    ///< 0: all cores; the bits do not depend on it
  std::uint64_t most_steps = std::uint64_t{1} << 62;  ///< of all trials together
};

struct SimulatedSteps {
  double mean = 0, standard_error = 0;  ///< of the steps before failure, the failing one included
  std::size_t trials = 0;
  std::vector<std::uint64_t> steps;  ///< of each trial
};

/// Follows every trial from `start` (a state at phase 0) to its failure; scores, or words for maps that draw for
/// themselves, come by counter (Philox) at trial and step. It returns nothing if most_steps do not suffice (a mean of
/// the trials that ended would be too low).
/// @throws std::invalid_argument for options out of range; MapError as checked_step does
std::optional<SimulatedSteps> simulate_steps(const BatchMap& map, std::span<const double> start,
                                             const SimulationOptions& options);

/// Returns mean and standard error of trials that all failed, two or more.
SimulatedSteps summarize_steps(std::vector<std::uint64_t> steps);

/// Follows every trial from `start` until it fails, `longest` steps at most. Returns the step in which each failed, 0
/// for those that walk on. Scores are those of simulate_steps(). `options.most_steps` is not read.
/// @param longest  >= 1
/// @throws as simulate_steps()
std::vector<std::uint64_t> follow_walks(const BatchMap& map, std::span<const double> start, std::uint64_t longest,
                                        const SimulationOptions& options);

/// The fewest trials to failure from which a mean is told, and how many walks are followed where not so many would
/// fail.
inline constexpr std::size_t fewest_trials = 100, walk_count = 512;

/// Says what trials to failure find beside walks of which some failed: "; ..." where enough fail within the steps
/// allowed, else nothing.
/// @param walked  the step in which each walk failed, 0 if it walked on for `longest` steps
/// @param options  most_steps: about so many steps are taken; `trials` is not read  @throws as simulate_steps()
std::string simulated_beside(const BatchMap& map, std::span<const double> start,
                             const std::vector<std::uint64_t>& walked, std::uint64_t longest,
                             const SimulationOptions& options);

/// Says what direct simulation finds where there is nothing else, and whether walks fail in it.
/// @param options  most_steps: about so many steps are taken; `trials` is not read  @throws as simulate_steps()
std::pair<std::string, bool> walks_in_words(const BatchMap& map, std::span<const double> start,
                                            const SimulationOptions& options);

}  // namespace metastable::markov
