#pragma once
// From an experiment to its diagnosis in one call.

#include <filesystem>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// diagnose() of the experiment's transition_model(), which Diagnosis::model then holds.
/// @throws std::invalid_argument as these
Diagnosis diagnose(const Experiment& experiment, const DiagnosisOptions& options = {});

/// The same for an experiment folder (experiment.toml, collisions.csv or counter logs).
/// @throws InputError for a defect of the folder, as read_experiment()
Diagnosis diagnose(const std::filesystem::path& folder, const DiagnosisOptions& options = {});

}  // namespace metastable::analysis
