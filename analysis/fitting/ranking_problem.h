#pragma once
// The inputs that all stages of a ranking of causes share.

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"

namespace metastable::analysis {

/// One experiment with its recalibrated model, and the effects that are considered. It outlives the ranking.
struct RankingProblem {
  const TransitionModel& model;
  const Fit& recalibrated;
  const std::vector<const Candidate*>& candidates;
  const Rules& rules;
  int threads;
  Effort effort;
  std::function<void()> heartbeat;  ///< called before every fit, from any thread; may throw to stop

  /// Returns 2 Delta penalised log likelihood of a fit over the recalibrated model.
  double gain(const Fit& fit) const { return 2 * (fit.penalised - recalibrated.penalised); }
  /// Returns the place of a candidate in the list.
  std::size_t index_of(const Candidate* candidate) const {
    return static_cast<std::size_t>(std::ranges::find(candidates, candidate) - candidates.begin());
  }
};

}  // namespace metastable::analysis
