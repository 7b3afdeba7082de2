#pragma once
// Finds rows of walks that nobody noted: the legs of the rows behind them are then the other ones.

#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Returns questions, which end in '?', where a step lasts, or leads, about twice as long as the others, and where the
/// legs of a machine whose step takes them (input "stance_leg") differ the other way round from some row of a trial
/// on. Both come of a row that was lost, behind which steps and legs were counted anew. The second shows only as far as
/// the legs differ: legs that are alike may be called as one likes. O(rows), one call of the map.
std::vector<std::string> questions_on_leg_turns(const Machine& machine, const MachineRuns& runs);

}  // namespace metastable::analysis
