#pragma once
// Follows one trial through its events, as wheel_events() lists them.

#include <memory>
#include <optional>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/speed_filter.h"
#include "analysis/wheel_model/wheel_hypothesis.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Computes the density of each event of one trial, given the events before it. Where the friction differs from trial
/// to trial, the density is averaged over nodes of that friction: each node follows the trial with its own friction and
/// has the weight of what it has explained so far, and nodes of negligible weight are dropped. Where no event leads up
/// to a collision (no launch is stated, or the stances are left out), the trial goes on from the collision's reported
/// speed.
class TrialFollower {
 public:
  /// Returns the contacts that followers sum over, which all trials share; nothing where the wheel's law has no use for
  /// them.
  static std::shared_ptr<const ContactNodes> contacts_for(const dynamics::ExtendedWheel& wheel,
                                                          const WheelHypothesis& hypothesis);

  /// All references must outlive the follower.
  /// @param wheel  under the hypothesis, on the ramp of the trial's condition
  /// @param contacts  contacts_for() this wheel and hypothesis
  TrialFollower(const WheelRuns& measured, const WheelRun& run, const dynamics::ExtendedWheel& wheel,
                const WheelHypothesis& hypothesis, std::shared_ptr<const ContactNodes> contacts);

  /// Returns the chance that the collision of this event, which comes next, ends in rest; 0 for events of no collision.
  double chance_of_rest(const Event& event);
  /// Returns log density, normal score and unit of the event that comes next.
  SpeedFilter::Out see(const Event& event);

 private:
  struct ScoreNode {  // of a rule for the standard normal
    double score, weight;
  };
  static std::vector<ScoreNode> nodes_for(double told);

  void come_to(const Event& event);
  SpeedFilter::Out seen_by(SpeedFilter& filter, const Event& event, double friction_shift) const;
  dynamics::StepContext context_of(const Event& event, double friction_shift) const;
  double friction_shift(std::size_t node) const;
  double largest_log_weight() const;

  const WheelRuns& measured_;
  const WheelRun& run_;
  const dynamics::ExtendedWheel& wheel_;
  const WheelHypothesis& hypothesis_;
  double day_shift_;    // of mu
  double friction_sd_;  // of the trial's own; 0: one node, without a shift
  std::vector<ScoreNode> nodes_;
  std::vector<SpeedFilter> filters_;  // by node
  std::vector<double> log_weight_;    // of the nodes
  std::optional<std::size_t> next_;   // the collision that the filters have come to
};

}  // namespace metastable::analysis
