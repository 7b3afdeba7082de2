#pragma once
// metastable steps

#include <cstddef>
#include <string>

#include "analysis/study/metastability.h"
#include "reports/commands/request.h"
#include "reports/study/study_json.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

void run_steps(const StepsRequest& request);

/// Holds what `steps` finds, and its renderings.
struct StepsAnswer {
  analysis::Metastability study;
  analysis::RestThresholds thresholds;
  StepsExtras extras;
};
/// @throws as analysis::study(); analysis::Contradiction where the certificate excludes the study's interval
StepsAnswer answer_steps(const StepsRequest& request, const BeginPart& begin);
std::string steps_answer_json(const StepsRequest& request, const StepsAnswer& answer);
/// @param width  of a line [characters]
std::string steps_answer_text(const StepsRequest& request, const StepsAnswer& answer, std::size_t width);

}  // namespace metastable::reports
