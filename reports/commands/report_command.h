#pragma once
// metastable report

#include "reports/commands/request.h"

namespace metastable::reports {

void run_report(const ReportRequest& request);

}  // namespace metastable::reports
