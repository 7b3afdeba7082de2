#include "analysis/experiment_model/diagnose.h"

#include <memory>
#include <ranges>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/experiment/suggestion.h"
#include "analysis/experiment_model/experiment_model.h"

namespace metastable::analysis {

namespace {

void require_known(const std::vector<std::string>& catalogue, const std::vector<std::string>& known) {
  for (const std::string& entry : catalogue)
    for (const auto id : std::views::split(entry, '+'))
      require_word("catalogue", std::string_view(id.begin(), id.end()), known);
}

}  // namespace

Diagnosis diagnose(const Experiment& experiment, const DiagnosisOptions& options) {
  std::shared_ptr<const TransitionModel> model = transition_model(experiment);
  require_known(options.catalogue, model->effect_ids());
  return diagnose(std::move(model), options);
}

Diagnosis diagnose(const std::filesystem::path& folder, const DiagnosisOptions& options) {
  return diagnose(read_experiment(folder), options);
}

}  // namespace metastable::analysis
