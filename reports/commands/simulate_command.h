#pragma once
// metastable simulate

#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "reports/commands/request.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request);
void run_reality(const RealityRequest& request);

/// The texts of an experiment folder, and what there is to say of it, a line a condition.
struct SimulatedExperiment {
  analysis::ExperimentSource source;
  std::vector<std::string> said;
};
/// @throws std::invalid_argument as analysis::simulate_trials() and analysis::laboratory_setup()
SimulatedExperiment simulated_experiment(const SimulateRequest& request);
SimulatedExperiment simulated_experiment(const RealityRequest& request);

}  // namespace metastable::reports
