#pragma once
// A map of a gap is plain data: cells along the facets of an experiment.

#include <cstddef>
#include <string>
#include <vector>

namespace metastable::analysis {

/// The facet of cells that hold all events, where stances and collisions are not separate.
inline constexpr const char* facet_of_all = "all";

/// Says whether a cell holds all stances, all collisions, or all events where these are not separate. A machine's
/// phases are in words of their own: "phase 2".
inline bool holds_all(const std::string& facet, const std::string& at) {
  return facet == facet_of_all || (facet == "phase" && !at.starts_with("phase "));
}

/// A cell of the map says how far one aspect is off in one place.
struct GapCell {
  /// Cells are sorted by speed, leg, position, collision, trial, time, phase, condition, outcome or pair of columns;
  /// those of facet_of_all hold all events.
  std::string facet;
  std::string aspect;          ///< mean, spread, tail, memory, correlation
  std::string at;              ///< the cell in words, with its phase where stance and collision are separate
  bool stance = false;         ///< of stance events, where they are separate
  bool swing = false;          ///< cosine or sine of the time since the previous collision: one of many
  double statistic = 0;        ///< standard normal without a gap
  double p_value = 1;          ///< of this cell alone
  double p_adjusted = 1;       ///< step-down max-T over all cells
  double false_discovery = 1;  ///< Benjamini and Hochberg's adjusted p-value, for the map
  double size = 0;             ///< [unit]
  double band = 0;             ///< half-width of the simultaneous 95 % band [unit]
  /// Says it in words: "rad/s" of a mean, "of the model's" of a spread, "share" of a tail, "correlation" of a memory
  /// and of trials as a whole, "share of collisions" of rests.
  std::string unit;
  std::size_t events = 0;
  bool of_all() const { return holds_all(facet, at); }
};

struct GapMap {
  std::vector<GapCell> cells;  ///< in the order of the facets
  double p_value = 1;          ///< smallest adjusted p-value
  /// Returns the largest squared statistic beyond what a misfit of this size in collisions and in stances would
  /// explain.
  double largest_beyond(double collisions, double stances) const;
};

}  // namespace metastable::analysis
