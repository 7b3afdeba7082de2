#pragma once
// How visible an effect is in an experiment: the strength of blind cases is defined by it.

#include <string>
#include <vector>

#include "analysis/diagnosis/transition_model.h"
#include "analysis/experiment/experiment.h"
#include "analysis/experiment/reality.h"

namespace metastable::analysis {

/// An experiment in the laboratory, with what its folder tells.
struct PowerDesign {
  std::vector<RealityCondition> conditions;  ///< stated; contact as it truly is
  RealityOptions reality;                    ///< without effects
  std::vector<std::string> dropped;
};

/// A catalogue effect as the diagnosis' model takes it: a candidate of one variant, and its values.
struct FittedForm {
  Candidate candidate;
  std::vector<double> values;
};
/// @param stated_legs  lengths [m], for leg_lengths
/// @param ramp_length  [m], for stretches that end with the ramp
/// @throws std::invalid_argument for contact_distribution, which is no candidate but the nuisances
FittedForm fitted_form(const dynamics::Effect& effect, const std::vector<double>& stated_legs, double ramp_length);

/// The nuisances of a model at a true contact distribution (others at their nominal values).
std::vector<double> true_nuisances(const TransitionModel& model, const dynamics::NominalValues& contact);

/// Mean over `replicates` laboratory experiments with the effects of 2 log(likelihood with them / without), true
/// contact known to both: about the effects' own noncentrality. Seeds follow design.reality.seed, apart from the case's
/// own. @throws std::invalid_argument for replicates < 1
double expected_power(const PowerDesign& design, const std::vector<dynamics::Effect>& effects, int replicates);

/// 2 log(likelihood of the truth / of the best recalibrated model without the effects) on one experiment: what is left
/// to be found once the contact is refitted.
/// @param kept  effects that the recalibrated model has, their sizes refitted too: what the others leave beside them
double power_left(const Experiment& experiment, const dynamics::NominalValues& truth,
                  const std::vector<dynamics::Effect>& effects, const std::vector<dynamics::Effect>& kept = {});

}  // namespace metastable::analysis
