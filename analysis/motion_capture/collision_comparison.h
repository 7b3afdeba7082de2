#pragma once
// Puts collisions found in recordings beside collisions that are known of the same trials.

#include <cstddef>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/motion_capture/angle_file.h"
#include "analysis/motion_capture/collision_finder.h"

namespace metastable::analysis {

/// Sums up found less known [rad/s].
struct SpeedDifferences {
  std::size_t count = 0;
  double bias = 0;             ///< their mean
  double bias_half_width = 0;  ///< of its normal 95 % interval; 0 for fewer than two
  double sd = 0;               ///< 0 for fewer than two
};

struct CollisionComparison {
  std::size_t due = 0;                                    ///< known collisions, of each trial the first `most`
  std::size_t found = 0;                                  ///< of these
  std::size_t others = 0;                                 ///< found where none is known
  SpeedDifferences written, peak, fit_before, fit_after;  ///< omega_minus as written, by both ways; omega_plus
};

/// A collision is found if one of its trial and number is, within 0.1 s where the known one has a time. Trials that are
/// not known are left out. O(collisions)
/// @param found  entry t holds the collisions found in angles[t]
/// @param peak   omega_minus is written as the smoothed speed's peak (reported_speed())
/// @param most   collisions of a trial that were asked for, >= 1
CollisionComparison compare_collisions(const Experiment& known, const std::vector<MeasuredAngle>& angles,
                                       const std::vector<FoundTrial>& found, bool peak, int most);

}  // namespace metastable::analysis
