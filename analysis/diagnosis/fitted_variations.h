#pragma once
// Fits what varies without a name, where scores at the recalibrated model see too little of it.

#include <functional>
#include <vector>

#include "analysis/diagnosis/left_over.h"
#include "analysis/diagnosis/model_fit.h"

namespace metastable::analysis {

/// Says of each of the model's variations alone what it gains over the recalibrated model: as a facet's chi-squared,
/// with its p-value over the variants and its evidence. Those that promise most are fitted; the others have what their
/// scores promise, and no more evidence than the best fitted one.
/// @param heartbeat  called before every fit, one at a time, from any thread; may throw to stop
std::vector<LeftInFacet> fitted_variations(const TransitionModel& model, const Fit& recalibrated, int threads,
                                           const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
