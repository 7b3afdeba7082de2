#pragma once
// metastable study

#include "reports/commands/request.h"

namespace metastable::reports {

/// Shows the paper's simulated figures and claims as a page with tables and figures.
/// @throws analysis::InputError, OutputError, std::invalid_argument (user errors: exit code 2)
void run_study(const StudyRequest& request);

}  // namespace metastable::reports
