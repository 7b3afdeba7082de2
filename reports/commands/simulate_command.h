#pragma once
// metastable simulate

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "reports/commands/request.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request);
void run_reality(const RealityRequest& request);

/// The texts of an experiment folder, and what there is to say of it, a line a condition.
struct SimulatedFiles {
  analysis::ExperimentFiles files;
  std::optional<std::string> angle_csv;
  std::vector<std::string> said;
};
/// @throws std::invalid_argument as analysis::simulate_trials() and analysis::laboratory_setup()
SimulatedFiles simulated_files(const SimulateRequest& request);
SimulatedFiles simulated_files(const RealityRequest& request);
/// @throws OutputError if the folder holds an experiment already, or cannot be written
void write_experiment(const std::filesystem::path& folder, const SimulatedFiles& made);

}  // namespace metastable::reports
