#pragma once
// metastable simulate

#include "reports/commands/request.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request);
void run_reality(const RealityRequest& request);

}  // namespace metastable::reports
