#pragma once
// What may vary in a machine without a name.

#include <functional>
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
  std::function<void(MachineHypothesis&, const std::vector<double>& variant, const std::vector<double>& values)> apply;
};

/// Lists what may vary without a name: each state is pushed, and the scores' spread changes, by what a step may go by.
std::vector<MachineVariation> machine_variations(const Machine& machine, std::shared_ptr<const MachineDesign> design);

}  // namespace metastable::analysis
