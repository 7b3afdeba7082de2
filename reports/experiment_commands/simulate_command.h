#pragma once
// metastable simulate

#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "reports/commands/request.h"
#include "reports/output/table.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request);
void simulate_in_laboratory(const LaboratoryRequest& request);

/// Holds the texts of an experiment folder, and what there is to say of it, a line a condition.
struct SimulatedExperiment {
  analysis::ExperimentSource source;
  std::vector<std::string> said;
  Provenance provenance;
};
/// @throws std::invalid_argument as analysis::simulate_trials() and analysis::laboratory_setup()
SimulatedExperiment simulated_experiment(const SimulateRequest& request, const BeginPart& begin);
SimulatedExperiment simulated_experiment(const LaboratoryRequest& request, const BeginPart& begin);

}  // namespace metastable::reports
