#pragma once
// metastable effects

#include "reports/request.h"

namespace metastable::reports {

void run_effects(const EffectsRequest& request);

}  // namespace metastable::reports
