#pragma once
// Says what columns that were not measured hide: the same design with and without each, by the information it holds.

#include <cstdint>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

struct Fit;

/// Lists effects that a missing column hides or makes much harder to see, and those that look alike for lack of it.
/// Both designs have data drawn from the recalibrated model, so that a gap does not blur the comparison.
/// @param candidates  to be compared; of each a few variants stand for all
std::vector<MissingColumn> missing_columns(const TransitionModel& model, const Fit& recalibrated,
                                           const std::vector<const Candidate*>& candidates, const Rules& rules,
                                           int threads, std::uint64_t seed);

}  // namespace metastable::analysis
