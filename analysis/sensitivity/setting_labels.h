#pragma once
// Names settings by what differs between them.

#include <string>
#include <vector>

#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Returns a name for each: every quantity that is not the same in all of them, "9.59 deg" or "law settled, mu 0.6";
/// settings that differ in nothing are told apart by their number from 1, "setting 2". A launch that is the paper's for
/// its slope goes without saying.
std::vector<std::string> setting_labels(const std::vector<Setting>& settings);

}  // namespace metastable::analysis
