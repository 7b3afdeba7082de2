#include "analysis/experiment_model/diagnose.h"

#include <memory>
#include <utility>

#include "analysis/experiment/suggestion.h"
#include "analysis/experiment_model/experiment_model.h"

namespace metastable::analysis {

Diagnosis diagnose(const Experiment& experiment, const DiagnosisOptions& options) {
  std::unique_ptr<const TransitionModel> model = transition_model(experiment);
  require_effects(options.catalogue, model->effect_ids());
  return diagnose(std::move(model), options);
}

Diagnosis diagnose(const std::filesystem::path& folder, const DiagnosisOptions& options) {
  return diagnose(read_experiment(folder), options);
}

}  // namespace metastable::analysis
