#pragma once
// Leads from an experiment to its diagnosis in one call.
//
// Example:
//   #include <metastable/analysis/experiment_model/diagnose.h>
//
//   #include <cstdio>
//
//   int main(int, char** arguments) {
//     // A folder with experiment.toml, collisions.csv and trials.csv; of the catalogue only what is suspected.
//     const auto answer = metastable::analysis::diagnose(
//         arguments[1], {.catalogue = {"leg_contact", "slope_offset"}, .draws = 200});
//     std::printf("%s\n", verdict_name(answer.verdict).c_str());
//     for (const auto& cause : answer.causes.ranked)
//       std::printf("%s: %.2f\n", cause.name().c_str(), cause.probability);
//   }
// prints
//   recalibrate
//   leg_contact: 0.13
//   slope_offset: 0.07

#include <filesystem>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Does diagnose() of the experiment's transition_model(), which Diagnosis::model then holds.
/// @throws std::invalid_argument as these
Diagnosis diagnose(const Experiment& experiment, const DiagnosisOptions& options = {});

/// Does the same for an experiment folder (experiment.toml, collisions.csv or counter logs).
/// @throws InputError for a defect of the folder, as read_experiment()
Diagnosis diagnose(const std::filesystem::path& folder, const DiagnosisOptions& options = {});

}  // namespace metastable::analysis
