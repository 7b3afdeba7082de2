#include "analysis/experiment_model/diagnose.h"

#include "analysis/experiment_model/experiment_model.h"

namespace metastable::analysis {

Diagnosis diagnose(const Experiment& experiment, const DiagnosisOptions& options) {
  return diagnose(transition_model(experiment), options);
}

Diagnosis diagnose(const std::filesystem::path& folder, const DiagnosisOptions& options) {
  return diagnose(read_experiment(folder), options);
}

}  // namespace metastable::analysis
