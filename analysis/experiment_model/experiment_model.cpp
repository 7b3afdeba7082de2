#include "analysis/experiment_model/experiment_model.h"

#include "analysis/drum_model/coast_down_transitions.h"
#include "analysis/wheel_model/wheel_transitions.h"

namespace metastable::analysis {

std::unique_ptr<TransitionModel> transition_model(const Experiment& experiment) {
  return experiment.system == System::coast_down ? coast_down_transitions(experiment) : wheel_transitions(experiment);
}

}  // namespace metastable::analysis
