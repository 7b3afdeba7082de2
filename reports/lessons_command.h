#pragma once
// `metastable lessons`: worked examples of the diagnosis, on the paper's wheel and on measured trials.

#include "reports/request.h"

namespace metastable::reports {

void run_lessons(const LessonsRequest& request);

}  // namespace metastable::reports
