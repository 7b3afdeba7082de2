#pragma once
// A study in words and numbers for the terminal, and its words shared with tables and pages.

#include <string>

#include "analysis/metastability.h"
#include "analysis/setting.h"
#include "reports/study_json.h"

namespace metastable::reports {

/// Everything `metastable steps` prints.
std::string study_text(const analysis::Setting& setting, const analysis::Metastability& study,
                       const RestThresholds& thresholds);

/// "4.256 (95 % interval 4.254 to 4.258)", or "infinite".
std::string estimate_text(const analysis::Estimate& estimate);

/// What the thresholds mean, one sentence.
std::string thresholds_text(const RestThresholds& thresholds);

}  // namespace metastable::reports
