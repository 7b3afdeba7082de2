#pragma once
// metastable coast-down

#include "reports/commands/request.h"

namespace metastable::reports {

void run_coast_down(const CoastDownRequest& request);

}  // namespace metastable::reports
