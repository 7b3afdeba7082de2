#pragma once
// metastable simulate

#include "reports/request.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request);

}  // namespace metastable::reports
