#pragma once
// A study's progress callback on a progress line.

#include <functional>
#include <string>

#include "reports/output/progress.h"

namespace metastable::reports {

/// Units to give Progress for one study.
inline constexpr std::size_t study_units = 1000;

/// A callback for analysis::StudyOptions::progress that moves `progress` by up to study_units over the study. The
/// callback refers to `progress`; it throws Interrupted after Ctrl-C.
std::function<void(double, const std::string&)> study_progress(Progress& progress);

}  // namespace metastable::reports
