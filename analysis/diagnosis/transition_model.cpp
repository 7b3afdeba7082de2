#include "analysis/diagnosis/transition_model.h"

#include <numeric>

namespace metastable::analysis {

double Evaluation::total() const { return std::accumulate(log_density.begin(), log_density.end(), 0.0); }

std::vector<Start> TransitionModel::starts(std::span<const Term>) const { return {}; }

std::string TransitionModel::size_in_words(std::span<const Term>) const { return {}; }

std::vector<double> TransitionModel::rest_chances(std::span<const double>, std::span<const Term>) const {
  return std::vector<double>(events().size(), 0);
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> TransitionModel::completed(
    std::span<const double>, std::uint64_t) const {
  return {};
}

}  // namespace metastable::analysis
