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

/// Draws first rows anew, as likely as the measured ones of trials with the same condition, phase, labels and columns:
/// from their smoothed distribution (SmoothSample), of which the errors of the sensors are no part once
/// simulate_machine() has taken them off. Nothing but the first rows differs.
MachineRuns smoothed_launches(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                              std::uint64_t seed);

/// Gives each trial the first row of a trial drawn from those with the same condition, phase, labels and columns: the
/// launches that as many trials might have had (a bootstrap).
MachineRuns resampled_launches(const MachineRuns& runs, std::uint64_t seed);

}  // namespace metastable::analysis
