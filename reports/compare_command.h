#pragma once
// metastable compare

#include "reports/request.h"

namespace metastable::reports {

void run_compare(const CompareRequest& request);

}  // namespace metastable::reports
