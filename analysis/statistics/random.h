#pragma once
// Draws the diagnosis's random numbers by counter: they are the same bits on any number of threads.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace metastable::analysis {

/// Returns the centre of one of 2^52 equal cells of (0, 1), picked by the upper bits of a random word: never 0 or 1.
inline double unit_interval(std::uint64_t word) { return (static_cast<double>(word >> 12) + 0.5) * 0x1p-52; }

/// Draws a uniform in (0, 1) from Philox4x64 at counter (index, number, stream), key (seed).
double uniform_at(std::uint64_t seed, std::uint64_t index, std::uint64_t number, std::uint64_t stream);

/// Says what draws under one seed are for; each has numbers of its own.
enum class DrawStream : std::uint64_t {
  chance_of_effects = 1,  ///< multipliers of the effects' scores
  chance_on_map = 2,      ///< multipliers of the map's scores
  held_out_weights = 3,   ///< weights of held-out trials
  folds = 4,              ///< the order in which trials go to folds
  blur = 5,               ///< errors added to speeds that are more exact than the law
  steps = 6,              ///< parameters of a fit, for its expected steps
  machine = 7,            ///< runs of a machine
  trial_groups = 8        ///< values of trials without groups: normals, or those that swing like a sine
};

/// Returns the standard normals by which a bootstrap multiplies scores: those of draw number `draw`.
std::vector<double> normal_multipliers(std::uint64_t seed, std::uint64_t draw, DrawStream stream, std::size_t count);

/// Returns standard normals, one from each of `count` equally likely cells, in random order: their mean and spread are
/// next to those of the distribution.
std::vector<double> even_normals(std::uint64_t seed, std::uint64_t draw, std::size_t count);

/// Returns the weight of a held-out trial in a bootstrap by exponential weights (mean 1): that of draw number `draw`.
double exponential_weight(std::uint64_t seed, std::uint64_t draw, std::uint64_t trial);

/// Returns a word by which to put trials into a random order.
std::uint64_t shuffling_key(std::uint64_t seed, std::uint64_t trial);

}  // namespace metastable::analysis
