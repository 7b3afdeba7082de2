#pragma once
// Says effect by effect what is at work, whatever else is.

#include <cstdint>
#include <functional>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/verdict.h"

namespace metastable::analysis {

/// An effect or a group counts as at work from this probability on: it is then four times as likely as not.
inline constexpr double least_at_work = 0.8;

/// Lists the effects of the likeliest hypotheses by their probability of being at work, each over all hypotheses that
/// hold it, with or without something unnamed; where none of the effects that act alike is at work by itself they are
/// one group. Where something without a name acts is listed by facet.
/// @param d  with ranked causes and their probabilities, unnamed, set and alike
void list_at_work(Diagnosis& d, const Odds& unnamed);

/// Fills in what the effects at work close of the held-out gap as given, added first and last.
/// @param given  the model as given  @param gap  HeldOutGap::gap
void add_closed_shares(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking, const Fit& given,
                       const Fit& recalibrated, const std::vector<double>& gap, const DiagnosisOptions& options,
                       const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
