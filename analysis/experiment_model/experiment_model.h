#pragma once
// Makes the transition model that belongs to an experiment.

#include <memory>

#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Returns wheel_transitions() or coast_down_transitions(). @throws std::invalid_argument as these
std::unique_ptr<TransitionModel> transition_model(const Experiment& experiment);

}  // namespace metastable::analysis
