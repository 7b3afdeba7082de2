#pragma once
// metastable sweep

#include "reports/commands/request.h"

namespace metastable::reports {

void run_sweep(const SweepRequest& request);

}  // namespace metastable::reports
