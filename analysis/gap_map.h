#pragma once
// Where a gap lies: scores of the fitted model, cut along the facets of the experiment.

#include <cstdint>
#include <string>
#include <vector>

#include "analysis/model_fit.h"

namespace metastable::analysis {

/// One cell of the map.
struct GapCell {
  std::string facet;           ///< speed, leg, position, collision, trial, time, phase, condition, outcome
  std::string aspect;          ///< mean, spread, tail, memory
  std::string at;              ///< the cell in words, with its phase where stance and collision are separate
  bool stance = false;         ///< of stance events, where they are separate
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

/// Scores of the events of `fit` in every cell: mean, spread, tail share, correlation with the previous one; what the
/// fitted parameters could take up is projected out. Chance levels from `draws` multiplier-bootstrap draws over trials.
GapMap gap_map(const TransitionModel& model, const Fit& fit, int draws, std::uint64_t seed);

/// The columns of the map that shift means, cell by cell [events x cells], for a flexible model of what is left.
Eigen::MatrixXd mean_columns(const TransitionModel& model);

}  // namespace metastable::analysis
