#pragma once
// Any machine as a transition model: what its user brings, with what was measured of it.

#include <memory>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Returns the transition model of a machine and its runs. A recalibration refits the parameters whose sd is above 0,
/// the errors of sensors whose sd is not stated, and the share of wild rows. Effects are those of machine_effects().
/// The map is called with many states at once, from several threads at once.
/// @throws std::invalid_argument as Machine::require_valid(), look_over(), score_plan(); where a measured state has
///   neither noise nor an error of measurement
std::unique_ptr<TransitionModel> machine_transitions(std::shared_ptr<const Machine> machine, MachineRuns runs);

}  // namespace metastable::analysis
