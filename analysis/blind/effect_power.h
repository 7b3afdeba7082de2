#pragma once
// Measures how visible an effect is in an experiment, which defines the strength of blind cases.

#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Describes an experiment in the laboratory, with what its folder tells.
struct PowerDesign {
  std::vector<LaboratoryCondition> conditions;  ///< stated; contact as it truly is
  LaboratoryOptions laboratory;                 ///< without effects of the catalogue
  std::vector<std::string> dropped;
};

/// Returns a catalogue effect as a wheel's model takes it.
/// @throws std::invalid_argument for an effect that is no candidate of the model, as contact_distribution (its
/// nuisances)
EffectTerm fitted_term(const TransitionModel& model, const dynamics::Effect& effect);

/// Returns those of the effects that are no contact_distribution as a wheel's model takes them.
std::vector<EffectTerm> fitted_terms(const TransitionModel& model, const std::vector<dynamics::Effect>& effects);

/// Returns the contact that is stated, or that of a contact_distribution among the effects.
dynamics::NominalValues contact_with(const dynamics::NominalValues& stated,
                                     const std::vector<dynamics::Effect>& effects);

/// Sets the nuisances of a wheel's model to a true contact distribution; the others stay at their nominal values.
std::vector<double> true_nuisances(const TransitionModel& model, const dynamics::NominalValues& contact);

/// Returns the mean over `replicates` laboratory experiments with the effects of 2 log(likelihood with them / without),
/// true contact known to both: about the effects' own noncentrality. Seeds follow design.laboratory.seed, apart from
/// the case's own. A design with an effect outside the catalogue is weighed by that one alone, and takes no others.
/// @throws std::invalid_argument for replicates < 1, and for an outside effect that cannot be weighed
double expected_power(const PowerDesign& design, const std::vector<dynamics::Effect>& effects, int replicates);

/// Returns 2 log(likelihood of the truth / of the best recalibrated model without the effects) on one experiment: what
/// is left to be found once the contact is refitted.
/// @param kept  effects that the recalibrated model has, their sizes refitted too: what the others leave beside them
/// @param fitted  whether the true contact and sizes are refitted, too: they are not the likeliest where something acts
///     that no model of the catalogue has
double power_left(const Experiment& experiment, const dynamics::NominalValues& truth,
                  const std::vector<dynamics::Effect>& effects, const std::vector<dynamics::Effect>& kept = {},
                  bool fitted = false);

/// Holds what the model as given lacks in likelihood, in the mean over experiments like the one it was asked of.
struct GapAsGiven {
  double all = 0;              ///< 2 log(likelihood of the truth / of the model as given)
  std::vector<double> alone;   ///< 2 log(likelihood of the model as given with one of the effects / as given)
  std::vector<double> beside;  ///< 2 log(likelihood of the truth / of the recalibrated model with the other effects)
};

/// Measures what the model as given lacks. Sizes are the true ones where all effects are in the model, and those that
/// fit best where some are. The contact's nuisances are refitted to the trials beside the true effects, since no model
/// states its skewness; experiments are drawn from that. Takes eight fits an effect.
/// @param nuisance, terms  of the truth
GapAsGiven gap_as_given(const TransitionModel& model, const std::vector<double>& nuisance,
                        const std::vector<EffectTerm>& terms);
/// Measures what a wheel's model as given lacks on an experiment.
GapAsGiven gap_as_given(const Experiment& experiment, const dynamics::NominalValues& truth,
                        const std::vector<dynamics::Effect>& effects);

}  // namespace metastable::analysis
