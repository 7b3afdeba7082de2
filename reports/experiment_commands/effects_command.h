#pragma once
// metastable effects

#include "reports/commands/request.h"

namespace metastable::reports {

void run_effects(const EffectsRequest& request);

}  // namespace metastable::reports
