#pragma once
// Finds how events answer to a number that is moved in single transitions. An effect that adds to that number in some
// of the transitions, by phase, by place or by trial, has slopes that are sums of such answers. They need no evaluation
// of their own.

#include <cstddef>
#include <vector>

#include "analysis/fitting/model_fit.h"

namespace metastable::analysis {

/// Holds how the events of a fit answer to one number of their model. An event answers to its own transition and to the
/// few before it that the measured values do not make forgotten. One evaluation, the probe, finds how many; then every
/// so many transitions are moved together, and as many evaluations move all of them.
class TransitionResponses {
 public:
  /// Evaluates the probe.
  /// @param number  Addition::number
  /// @param step  by which a transition's number is moved for a difference, where data do not resolve it; else less
  /// @throws std::logic_error for a model without additions
  TransitionResponses(const TransitionModel& model, const Fit& fit, std::size_t number, double step);
  /// Returns how many evaluations move all transitions; 0: events remember for too long.
  std::size_t evaluations() const { return lags_; }
  /// Makes the evaluation `which`. Different ones may be made on several threads.
  void evaluate(std::size_t which);
  /// Fills a column with the slopes and changes a unit of the addition. All evaluations have been made.
  void fill(const Addition& addition, Eigen::Index column, Derivatives& all) const;

 private:
  Evaluation moved(std::size_t every, std::size_t first) const;

  const TransitionModel& model_;
  const Fit& fit_;
  std::size_t number_, lags_ = 0;
  double step_;
  std::vector<std::size_t> first_;  // by trial: number of its first transition; and how many there are
  Derivatives answers_;             // [events x evaluations]
};

}  // namespace metastable::analysis
