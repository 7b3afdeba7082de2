#pragma once
// Lists fitted values that stand at an end of their range, where an interval has one side only.

#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/model_fit.h"

namespace metastable::analysis {

/// Lists those of a hypothesis: parameters of its effects, except at the value that means no effect, and nuisances, in
/// that order. The lower end of an sd, a jitter or a share that is fitted by its logarithm is next to nothing, and not
/// listed.
std::vector<AtBound> values_at_bound(const TransitionModel& model, const Fit& fit);

/// Says it in a sentence. @param beside  effects of the hypothesis, by which its nuisances may differ from those of the
/// recalibrated model
std::string at_bound_in_words(const AtBound& one, const std::vector<EffectTerm>& beside = {});

}  // namespace metastable::analysis
