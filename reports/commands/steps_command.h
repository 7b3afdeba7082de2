#pragma once
// metastable steps

#include "reports/commands/request.h"

namespace metastable::reports {

void run_steps(const StepsRequest& request);

}  // namespace metastable::reports
