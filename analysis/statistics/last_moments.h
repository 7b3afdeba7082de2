#pragma once
// Says in numbers how something fails: what its last steps look like beside all others. It knows no wheel, no walker.

#include <span>
#include <string>
#include <vector>

#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// Returns the weighted median as value, 5 % and 95 % quantiles as ends, of a continuous distribution: a value's weight
/// is spread evenly over the width around it, as the start of a step is over its cell. Without widths a value stands in
/// the middle of its weight, with straight lines between; equal values (to 1e-9 of their range) count as one.
/// @param weights  >= 0, as many as values, some > 0 (otherwise std::invalid_argument)
/// @param widths   >= 0, as many as values, or none
Estimate middle_90(std::span<const double> values, std::span<const double> weights,
                   std::span<const double> widths = {});

/// Returns the value below which a share `level`, in [0, 1], of the weight lies, as middle_90() without widths.
double weighted_quantile(std::span<const double> values, std::span<const double> weights, double level);

/// Holds 95 % intervals of a median and of the two ends of a middle 90 %; their ends are NaN where they are not known.
struct SpreadIntervals {
  Estimate median, low, high;
};

/// Says what steps are like: medians with the middle 90 %.
struct StepProfile {
  std::vector<Estimate> state;  ///< at the beginning of the step, one a number of the state
  std::vector<Estimate> noise;  ///< met in it
  /// Say how well these are known, where independent rounds tell it; else empty.
  std::vector<SpreadIntervals> state_95, noise_95;
  double bound_to_fail =
      0;  ///< mean chance, at its beginning, of failing before being back in the middle of the regime
};

/// One step of a path: the state in which it begins, the noise that leads on to the next (or to failure).
struct PathStep {
  int phase = 0;
  std::vector<double> state, noise;
};

/// Holds the failures of one chain, from its last steps backwards.
struct LastMoments {
  std::vector<std::string> state_names, noise_names;  ///< with units
  std::vector<StepProfile> last;                      ///< last[0]: the step that fails, last[1]: the one before ...
  StepProfile regime;                                 ///< all steps of the metastable regime
  std::vector<double> by_phase;                       ///< share of the failures in each phase's step; sums to one
  std::vector<Estimate> by_phase_95;                  ///< likewise with intervals, where rounds tell them; else empty
  std::vector<PathStep> likeliest;                    ///< the most likely last steps, the one that fails at the end
  std::string reason;                                 ///< why there is nothing; empty if there is
};

}  // namespace metastable::analysis
