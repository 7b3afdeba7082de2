#pragma once
// Variations of a machine that no effect names.

#include <memory>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_hypothesis.h"

namespace metastable::analysis {

/// Something that varies without a name, and what it does to what is supposed of the machine.
struct MachineVariation {
  Variation variation;
  MachineChange apply;
};

/// Lists the variations: a push of each state, and a change of the scores' spread, each as a function of the states,
/// the inputs of this step and of the two before, the phase, the order of trials, the step number, the place, the clock
/// and the labels; and pushes that swing with a frequency of their own, from the launch on or, state by state, with a
/// phase and a size of its own in each trial (of machines whose calls are dear, those with one measured state alone).
std::vector<MachineVariation> machine_variations(const Machine& machine, std::shared_ptr<const MachineDesign> design);

/// Returns the push of every measured state by a number of its own, the same at every step. It is not among the
/// variations: a shift of the mean is what parameters and effects are fitted by.
MachineVariation even_push(const Machine& machine, std::shared_ptr<const MachineDesign> design);

}  // namespace metastable::analysis
