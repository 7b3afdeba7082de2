#pragma once
// metastable compare

#include <string>
#include <vector>

#include "analysis/sensitivity/comparison.h"
#include "analysis/study/metastability.h"
#include "reports/commands/request.h"
#include "reports/study/study_json.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

void run_compare(const CompareRequest& request);

/// Holds what `compare` finds, and its renderings.
struct CompareAnswer {
  analysis::Comparison comparison;
  std::vector<analysis::RestThresholds> thresholds;  ///< a setting each
  CompareExtras extras;
};
/// @throws as analysis::compare()
CompareAnswer answer_compare(const CompareRequest& request, const BeginPart& begin);
std::string compare_answer_json(const CompareRequest& request, const CompareAnswer& answer);
std::string compare_answer_text(const CompareRequest& request, const CompareAnswer& answer);

}  // namespace metastable::reports
