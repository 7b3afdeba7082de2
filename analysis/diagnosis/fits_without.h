#pragma once
// Holds the fits of a hypothesis without each of its effects.

#include <cstddef>
#include <deque>
#include <functional>
#include <vector>

#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {

/// The fits of a hypothesis without each of its effects, of which those that the search has not made are made when they
/// are first asked for. What it was made of outlives it.
class FitsWithout {
 public:
  FitsWithout(const TransitionModel& model, const CauseRanking& ranking, const RankedCause& best,
              const Fit& recalibrated);
  /// Returns the fit without the term at this place, refitted with its nuisances.
  /// @param heartbeat  called before a fit; may throw to stop
  const Fit& term(std::size_t place, const std::function<void()>& heartbeat = {});

 private:
  const TransitionModel& model_;
  const CauseRanking& ranking_;
  const RankedCause& best_;
  const Fit& recalibrated_;
  std::vector<const Fit*> known_;  // by term; null until it was asked for
  std::deque<Fit> made_;
};

}  // namespace metastable::analysis
