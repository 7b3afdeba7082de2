#pragma once
// The transition model that belongs to an experiment.

#include <memory>

#include "analysis/experiment.h"
#include "analysis/transition_model.h"

namespace metastable::analysis {

/// wheel_transitions() or coast_down_transitions(). @throws std::invalid_argument as these
std::unique_ptr<TransitionModel> transition_model(const Experiment& experiment);

}  // namespace metastable::analysis
