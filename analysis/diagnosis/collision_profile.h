#pragma once
// Says how the speed runs on from collision to collision, measured and simulated.

#include <cstdint>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/model_fit.h"
#include "analysis/diagnosis/transition_model.h"

namespace metastable::analysis {

/// Returns the mean speed before each collision by condition, up to the 40th, where three trials or more have one. The
/// means of the nominal and of the chosen model are taken over four simulated experiments each.
std::vector<ProfilePoint> collision_profile(const TransitionModel& model, const std::vector<double>& nominal,
                                            const Fit& chosen, std::uint64_t seed);

}  // namespace metastable::analysis
