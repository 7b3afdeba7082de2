#pragma once
// A map of a gap, as plain data: cells along the facets of an experiment.

#include <cstddef>
#include <string>
#include <vector>

namespace metastable::analysis {

/// One cell of the map.
struct GapCell {
  std::string facet;           ///< speed, leg, position, collision, trial, time, phase, condition, outcome
  std::string aspect;          ///< mean, spread, tail, memory
  std::string at;              ///< the cell in words, with its phase where stance and collision are separate
  bool stance = false;         ///< of stance events, where they are separate
  bool swing = false;          ///< cosine or sine of the time since the previous collision: one of many
  double statistic = 0;        ///< standard normal without a gap
  double p_value = 1;          ///< of this cell alone
  double p_adjusted = 1;       ///< step-down max-T over all cells
  double false_discovery = 1;  ///< Benjamini and Hochberg's adjusted p-value, for the map
  double size = 0;             ///< [unit]
  double band = 0;             ///< half-width of the simultaneous 95 % band [unit]
  std::string unit;            ///< "rad/s", "" for a ratio or a correlation, "rests"
  std::size_t events = 0;
};

struct GapMap {
  std::vector<GapCell> cells;  ///< in the order of the facets
  double p_value = 1;          ///< smallest adjusted p-value
  double largest = 0;          ///< largest squared statistic
  /// Largest squared statistic beyond what a misfit of the given size in collisions and in stances would explain.
  double largest_beyond(double collisions, double stances) const;
};

}  // namespace metastable::analysis
