#pragma once
// metastable compare

#include "reports/commands/request.h"

namespace metastable::reports {

void run_compare(const CompareRequest& request);

}  // namespace metastable::reports
