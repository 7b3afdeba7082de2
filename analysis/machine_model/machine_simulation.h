#pragma once
// Draws runs of a machine.

#include <cstdint>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Draws the same design (trials, launches, columns, what is missing) under a hypothesis. Launches are those measured,
/// less an error drawn anew. A trial that failed may go on to the length of the longest. The same seed gives the same
/// data.
MachineRuns simulate_machine(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                             std::uint64_t seed);

}  // namespace metastable::analysis
