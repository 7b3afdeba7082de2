#include "analysis/study/rest_thresholds.h"

#include <cmath>

#include "analysis/study/rest_reachability.h"

namespace metastable::analysis {

RestThresholds rest_thresholds(const Metastability& study) {
  RestThresholds thresholds;
  if (study.steps.safe_state) thresholds.safe_speed = std::sqrt(*study.steps.safe_state);
  thresholds.safe_slope_deg = safe_slope_deg(study.setting.value());
  thresholds.slope_sought = study.setting->law != dynamics::Law::settled;
  return thresholds;
}

}  // namespace metastable::analysis
