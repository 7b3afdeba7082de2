#pragma once
// metastable describe

#include "reports/commands/request.h"

namespace metastable::reports {

/// What an experiment folder's trials show: tables on the terminal (Markdown), or a folder with tables, figures and a
/// page. @throws analysis::InputError, OutputError, std::invalid_argument (user errors: exit code 2)
void run_describe(const DescribeRequest& request);

}  // namespace metastable::reports
