#pragma once
// Tells fitted parameters in the numbers that a catalogue reports, with their 90 % intervals.

#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

struct EffectScan;
struct Fit;
struct RankedCause;

/// Returns a ranked hypothesis as the diagnosis tells it, all but its probability. Without information the parameters
/// of its effects are left out. Where the data hardly tell the variants of a single effect apart (where a sag ends),
/// the interval of its size covers what the others say, each by its likelihood.
/// @param scan    at the recalibrated model
/// @param likely  If true, the interval of an effect of one value reaches as far as the likelihood does
///                (likelihood_ends()) or its curvature; that of a spread or a share, which has no other side than none,
///                follows the likelihood towards none. If false, it follows the curvature, which costs nothing.
Cause described_cause(const TransitionModel& model, const RankedCause& ranked, const EffectScan& scan, bool likely);

/// Returns what a recalibration refits, as this fit has it. Intervals hold chance and Nuisance::form_sd. Those of
/// numbers that one nuisance alone moves reach as far as the likelihood does (likelihood_ends()) or its curvature, the
/// others follow the slopes of the reported numbers.
std::vector<EstimatedParameter> contact_estimates(const TransitionModel& model, const Fit& fit);

}  // namespace metastable::analysis
