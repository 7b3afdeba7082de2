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

/// A gap as given, of which parts are asked: from the model as given to the best one, and what that leaves.
struct WholeGap {
  const Fit *best = nullptr, *given = nullptr;  ///< fitted with its nuisances; with nothing fitted
  const std::vector<double>& left;              ///< HeldOutGap::left
};

/// Says what share of the gap lies between the two models of each part, in log score, by a bootstrap of 400 draws. What
/// a model says of a trial is the mean of what it says where the trial is fitted and where it is held out, each model
/// refitted in every fold, weighted so that what fitting gains by chance and what it costs cancel. Without that a model
/// of more parameters would close less the fewer trials there are. What is left counts for nothing where it is less.
/// @param parts  of fits to all trials
/// @param heartbeat  called before every fit, from any thread, one at a time; may throw to stop
std::vector<ClosedShare> parts_closed(const TransitionModel& model, const Fit& recalibrated, const WholeGap& gap,
                                      const std::vector<GapPart>& parts, int folds, int threads, std::uint64_t seed,
                                      const std::function<void()>& heartbeat = {});

}  // namespace metastable::analysis
