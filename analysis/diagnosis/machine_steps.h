#pragma once
// The expected steps of the machine that was measured: what its models say and what was counted, joined.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/model_fit.h"

namespace metastable::analysis {

/// A fitted model with its probability.
struct WeighedFit {
  const Fit* fit = nullptr;
  double weight = 1;
};

/// The place that was asked about, in words, with its design; no design: none was.
using Elsewhere = std::pair<std::string, std::unique_ptr<TransitionModel>>;

/// Counts what was seen: rests among the collisions at risk, with exact 90 % limits of a Poisson mean.
/// @param rests  TransitionModel::rests()
void set_observed(StepsBeforeFailure& steps, std::pair<double, double> rests);

/// Draws the expected steps that a mixture of fits leaves open: parameters from the normal distribution that their
/// information has, widened where an error of the model's form moves one of them and the fit the others with it,
/// launches that so many trials leave possible, and each draw's own simulation. Infinite where a draw never rests.
/// @param at  the experiment that is asked about, of the same parameters as the fits
/// @param draws  >= 1
std::vector<double> drawn_steps(const TransitionModel& model, const TransitionModel& at,
                                const std::vector<WeighedFit>& fits, int draws, std::uint64_t seed, int threads,
                                const std::function<void()>& heartbeat);

/// Returns the median of draws with their 5 and 95 % quantiles, by the moments of the logarithms of those that come to
/// rest; infinite ends where more than so many never do. @param draws  not empty
Estimate interval_of_draws(const std::vector<double>& draws);

/// The error of a model in the logarithm of the expected steps: its sd where trials were counted, and the sd by which
/// it differs elsewhere, for a change of the steps by a factor of e.
struct ModelError {
  double here = 0, elsewhere = 0;
};

/// Joins the draws of a model with the count, by Bayes's rule on a grid of the model's error: that multiplies what the
/// model says here and there alike. The count corrects the model's error alone: the likelihood of the fits already
/// holds every rest, so that their parameters are not weighed by it again.
/// @param here  draws for the experiment that was counted  @param there  for the one asked about, draw by draw
/// @param at_risk, rests  at_risk 0: nothing was counted
Estimate joined_steps(const std::vector<double>& here, const std::vector<double>& there, const ModelError& error,
                      double at_risk, double rests);

/// Returns what the steps of a model are, as a multiple of the machine's, by the same rule: what is known of the
/// model's error once the machine's failures were counted. @param rests  > 0
Estimate steps_of_model_by_machine(const std::vector<double>& here, const ModelError& error, double at_risk,
                                   double rests);

/// Returns the joined interval, or that of the count where it is the narrower one: a model that leaves more open than
/// the rests do by themselves says nothing of them.
/// @param counted  as set_observed() leaves it
Estimate bounded_by_count(const Estimate& joined, const StepsBeforeFailure& counted);

/// Returns what is known where no trial failed: a lower end alone. It is the larger one of two with 95 % each: of the
/// count's, which holds for the experiment measured, and of what the models leave open, where they explain the data; 1,
/// which says nothing, at least.
/// @param model_lower  the lower end of joined_steps()  @param counted  as set_observed() leaves it
MachineSteps survivors_steps(const std::string& where, double model_lower, const StepsBeforeFailure& counted,
                             bool explained);

/// Fills in StepsBeforeFailure::later and ::later_times under a fit, infinity where no failure is to be expected in the
/// later half. They stay 0 where outcomes are not known, and where too few steps are later ones.
void set_later_steps(StepsBeforeFailure& steps, const TransitionModel& model, const Fit& fit);

/// Fills in what was counted, and the machine's steps by that alone.
/// @param rests  TransitionModel::rests()
void add_counted_steps(StepsBeforeFailure& steps, std::pair<double, double> rests);

/// Fills in the intervals of the models' expected steps, and the machine's own; none where neither the models nor the
/// count bound them.
/// @param fits  the models that may be the machine, by their probabilities (none: the recalibrated model alone)
/// @param d  with its verdict, its held-out measures and the steps observed and expected
void add_machine_steps(Diagnosis& d, const TransitionModel& model, const WeighedFit& recalibrated,
                       const std::vector<WeighedFit>& fits, const Elsewhere& elsewhere, const DiagnosisOptions& options,
                       const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
