#pragma once
// Makes blind cases of the compass gait, from its laboratory.

#include <cstdint>
#include <vector>

#include "analysis/blind/blind_cases.h"
#include "analysis/walker_model/walk_folder.h"

namespace metastable::analysis {

/// Draws case `number` (from 1) of a plan of walkers, as blind_case() does: 40 to 50 trials of 9 to 12 steps. Powers
/// are those of the walkers' own model; that of an effect which no catalogue holds is what it takes from the likelihood
/// of the model recalibrated to the walks, which stays in truth.left where no other effect is there.
BlindCase walker_case(const BlindPlan& plan, int number, std::uint64_t seed);

/// Sets truth.left from the case's own walks; a case without effects of the catalogue keeps what it has.
void complete_walker_truth(BlindCase& made);

/// Returns 2 log(likelihood of the truth / of the best recalibrated model without the effects) on these walks.
/// @param slope_deg  true mean and sd from step to step
/// @param kept, fitted  as in power_left()
double walk_power_left(const Walks& walks, const Spread& slope_deg, const std::vector<dynamics::Effect>& effects,
                       const std::vector<dynamics::Effect>& kept = {}, bool fitted = false);

}  // namespace metastable::analysis
