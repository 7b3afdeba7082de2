#pragma once
// `metastable lessons` shows worked examples of the diagnosis, on the paper's wheel and on measured trials.

#include "reports/commands/request.h"

namespace metastable::reports {

void run_lessons(const LessonsRequest& request);

}  // namespace metastable::reports
