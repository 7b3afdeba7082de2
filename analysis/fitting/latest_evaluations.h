#pragma once
// Holds what a model has been asked lately.

#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// The latest evaluations of a model: the stages of a diagnosis repeat each other's fits, which then go through the
/// same hypotheses. A copy starts without any, since it may be of other runs. Several threads may ask at once.
class LatestEvaluations {
 public:
  LatestEvaluations() = default;
  LatestEvaluations(const LatestEvaluations&) {}
  LatestEvaluations& operator=(const LatestEvaluations&) = delete;

  /// Returns the evaluation of a hypothesis, which `evaluate` makes unless it is held. An effect is known by its id.
  Evaluation of(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                const std::function<Evaluation()>& evaluate);

 private:
  std::mutex mutex_;
  std::unordered_map<std::string, Evaluation> held_;
  std::deque<std::string> order_;  // The oldest comes first.
};

}  // namespace metastable::analysis
