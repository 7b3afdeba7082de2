#pragma once
// Fits models to some of the trials, and says what parts of the gap they close on the others.

#include <cstdint>
#include <functional>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// Returns [trials] their folds, 0 .. folds - 1: trials go to folds in turn, in an order of their own.
std::vector<int> folds_of_trials(std::size_t trials, int folds, std::uint64_t seed);

/// Fits the trials counted, from a fit of all.
Fit fit_from(const Fit& start, const TransitionModel& model, const Fit& recalibrated, FitOptions options);

/// Two models of which the first is held to close more of the gap.
struct GapPart {
  const Fit *with = nullptr, *without = nullptr;
  bool recalibrated = true;  ///< both are refitted with their nuisances; false: these stay as the fits have them
};

/// A share of the gap, with what a bootstrap over trials makes of it.
struct ClosedShare {
  double value = 0;
  std::vector<double> drawn;  ///< by draw, the same draws for all shares of one gap

  /// Returns it with its 90 % interval.
  Estimate estimate() const;
  /// Returns the mean of two shares, draw by draw.
  friend ClosedShare mean_of(const ClosedShare& one, const ClosedShare& other);
};

/// Says what share of the held-out gap lies between the two models of each part, in log score, each refitted in every
/// fold, by a bootstrap of 400 draws.
/// @param gap  [trials] HeldOutGap::gap, of the same folds and seed
/// @param heartbeat  called before every fit, from any thread, one at a time; may throw to stop
std::vector<ClosedShare> parts_closed(const TransitionModel& model, const Fit& recalibrated,
                                      const std::vector<double>& gap, const std::vector<GapPart>& parts, int folds,
                                      int threads, std::uint64_t seed, const std::function<void()>& heartbeat = {});

}  // namespace metastable::analysis
