#pragma once
// Says how far the gap shrinks: models compared on trials they were not fitted to.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

struct Fit;

/// A measure of the gap under the models compared, held out, and on data of the last model itself.
struct Shrinkage {
  std::string measure, unit;
  double baseline = 0, recalibrated = 0, with_effect = 0, floor = 0;
  /// The closed share (baseline - with_effect) / (baseline - floor), at most 1, as no model leaves less than nothing;
  /// no value where the denominator's interval covers zero.
  std::optional<double> closed, closed_lower, closed_upper;  ///< 90 % interval over trials
  double baseline_lower = 0, baseline_upper = 0;             ///< 90 %
  double with_effect_lower = 0, with_effect_upper = 0;       ///< 90 %
  double with_effect_least = 0;  ///< of with_effect when trials are drawn anew, some hundred times
};

/// The expected steps of the machine itself: what its models leave open and what was counted, joined.
struct MachineSteps {
  std::string where;      ///< the place that was asked about, as "on a slope of 8 deg"; "": as measured
  Estimate steps;         ///< 90 %
  bool at_least = false;  ///< neither the count nor the models bound them above: the lower end alone holds, with 95 %
};

struct StepsBeforeFailure {
  double observed = 0, observed_lower = 0,
         observed_upper = 0;  ///< collisions at risk by rests, exact 90 %; 0: not known
  double baseline = 0, recalibrated = 0, with_effect = 0;
  /// Intervals of the last two (90 %), which the fitted parameters and the hypotheses' probabilities leave open.
  std::optional<Estimate> recalibrated_90 = {}, with_effect_90 = {};
  std::vector<MachineSteps> machine = {};  ///< as measured; then the place that was asked about
  /// Steps for each failure over the later half of all measured steps, by their number in their trial and by the chosen
  /// model, and how many times those over whole trials this is; 0: not known. The numbers above are of whole trials
  /// that end where the measured ones do.
  double later = 0, later_times = 0;
  /// Steps of the model that leaves out what has no name, as a multiple of the machine's own (90 %): what ignoring it
  /// costs. The model is the one with the effects at work, or the recalibrated one where none is; no value where
  /// nothing stays or no failure was counted.
  std::optional<Estimate> without_unnamed = {};
};

/// The measures, and what each trial says of what is left.
struct HeldOutGap {
  std::vector<Shrinkage> measures;
  std::vector<double> left;  ///< [trials] log score of the flexible model over the chosen one, less the floor [nats]
};

/// Cross-validates by trial: in every fold nuisances and each of `rivals` are refitted to the other trials, the rival
/// with the best penalised likelihood there, less a price of its parameters without a prior, is used on the held-out
/// ones (an empty list of terms: none). Measures:
/// log score per collision below that of a flexible model (the chosen one plus a ridge-fitted shift in every cell of
/// the gap map, cross-fitted), and CRPS of the next speed where one column is observed and no model has most values in
/// its tails. The floor is the same measure on data of the chosen model itself. Intervals are 90 % over trials, by a
/// bootstrap of 400 draws; that of the share closed ends at 1.
/// @param given  its evaluation is that of the model as given
/// @param rivals  fits of the same model; none: the recalibrated model stands for the chosen one
/// @param folds  >= 2 @throws std::invalid_argument for fewer
/// @param heartbeat  called before every fit, from any thread, one at a time; may throw to stop
HeldOutGap gap_shrinkage(const TransitionModel& model, const Fit& given, const Fit& recalibrated,
                         const std::vector<const Fit*>& rivals, int folds, int threads, std::uint64_t seed,
                         const std::function<void()>& heartbeat = {});

/// Returns what held-out trials show as a gap where there is none [nats a collision]: the mean of the log score's
/// measure over two experiments drawn from the model of `chosen`, refitted. A likelihood that reads its landings from a
/// table leaves some.
double gap_by_itself(const TransitionModel& model, const Fit& chosen, int folds, int threads, std::uint64_t seed,
                     const std::function<void()>& heartbeat = {});

/// Compares the share of steps that end a trial (a wheel's collisions that rest), model against observed, by what the
/// models expect in steps before failure. They are counts, so intervals are those of a Poisson mean (exact, 90 %), and
/// the floor is the mean deviation of such a count from the last model's own expectation. All trials count: such steps
/// are too few to hold any out.
/// @param at_risk, rests  steps observed, and those of them that ended a trial; at_risk > 0
/// @param measure  its name in the table
Shrinkage rest_shrinkage(double at_risk, double rests, const StepsBeforeFailure& steps, const std::string& measure);

}  // namespace metastable::analysis
