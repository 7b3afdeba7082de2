#pragma once
// Shows in cells what is common to descriptions: speeds, and what tests say of two of them.

#include <optional>

#include "analysis/description/speed_profile.h"
#include "analysis/statistics/two_sample_tests.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Returns the mean of two values or more with its t-interval.
Estimate mean_interval(const analysis::SpeedSummary& s);
/// Shows the mean, with its interval where there are two values or more; empty where there is none.
Cell mean_cell(const analysis::SpeedSummary& s);
/// Shows the standard deviation; empty where there are not two values.
Cell sd_cell(const analysis::SpeedSummary& s);
/// Shows an effect with its interval; infinite where it is no finite number.
Cell effect_cell(const analysis::EffectSize& effect);
/// Shows the first collision from which on two conditions are not told apart.
Cell meet_cell(const std::optional<int>& collision);

}  // namespace metastable::reports
