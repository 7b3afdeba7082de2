#pragma once
// Reads experiment folders of machines that their user brings: `model = "none"`.

#include <filesystem>
#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Reads steps.csv and trials.csv of a folder whose experiment.toml states `system = "machine"` and `model = "none"`:
/// the columns that the machine observes, its inputs, and labels. What experiment.toml says of parameters, sensors and
/// inputs has to be what the machine says.
/// @param labels  names of columns beside those that experiment.toml lists as `labels`
/// @throws InputError with the first 20 defects, each with file, line and column; with one alone where the folder is
///   another machine's, or where a label of the call is empty, there twice or another column's name
MachineRuns read_machine_folder(const std::filesystem::path& folder, const Machine& machine,
                                const std::vector<std::string>& labels = {});

}  // namespace metastable::analysis
