#pragma once
// metastable effects

#include "analysis/walker_model/walk_folder.h"
#include "reports/commands/request.h"

namespace metastable::reports {

void run_effects(const EffectsRequest& request);
/// Lists those of walks (`--walker`). @throws std::invalid_argument for the biped
void run_walker_effects(const EffectsRequest& request, analysis::Walker walker);

}  // namespace metastable::reports
