#pragma once
// The effects of a machine as they are fitted: those that its user suspects, and those that any machine may have.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_hypothesis.h"

namespace metastable::analysis {

/// An effect as it is fitted, and what it does to what is supposed of the machine.
struct MachineCandidate {
  Candidate candidate;
  MachineChange apply;
};

/// Lists the suspected effects by their ids; then, for each parameter q that may vary, q_by_phase, q_drift (over the
/// order of runs), q_spread (from trial to trial), q_clock (a sine of time), q_stretch (of the way), q_with_STATE (for
/// each measured state) and q_by_LABEL; then memory (of the scores), lag_INPUT and filtered_INPUT (it acts later, or
/// through a filter of first order), hidden_state_STATE (a state that the map lacks follows a measured one and pushes a
/// measured one), outliers (of the scores), sensor_noise_STATE and sensor_bias_STATE for each measured state, and
/// launch_STATE and launch_spread_STATE (first values that are off, or scatter more than it is stated) for each state
/// that is measured or whose launch is stated. Those that the runs cannot show say why.
std::vector<MachineCandidate> machine_effects(const Machine& machine, std::shared_ptr<const MachineDesign> design);

/// Says in a sentence that phases alternate from step to step as a memory below zero does, where both do; else "".
std::string alternating_memory(const MachineDesign& design, std::span<const EffectTerm> terms);

/// Names the effects that a machine with these parameters, states and inputs may have whatever its runs are: those of
/// machine_effects() that its user does not suspect, but for q_by_LABEL.
std::vector<std::string> generic_effect_names(const Machine& machine);

/// Returns the unit of a parameter that such an effect reports, by Machine::unit_of() of what the effect changes; ""
/// for a ratio, a share and a number of steps.
std::string machine_effect_unit(const Machine& machine, const std::string& effect, const std::string& parameter);

}  // namespace metastable::analysis
