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
/// @param scan  at the recalibrated model
Cause described_cause(const TransitionModel& model, const RankedCause& ranked, const EffectScan& scan);

/// Returns the recalibrated contact. Intervals hold chance and Nuisance::form_sd, and follow the slopes of the reported
/// numbers, unless those take a positive one below zero.
std::vector<EstimatedParameter> contact_estimates(const TransitionModel& model, const Fit& fit);

}  // namespace metastable::analysis
