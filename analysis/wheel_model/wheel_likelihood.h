#pragma once
// Says how likely a wheel's measured trials are under a hypothesis.

#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/wheel_hypothesis.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Returns log density and normal score of each event, as a TrialFollower sees them; values without a finite one are
/// held at least_log_density and a score of -8.
/// @param events  wheel_events(measured)
/// @throws std::invalid_argument as dynamics::ExtendedWheel
Evaluation wheel_likelihood(const WheelRuns& measured, const std::vector<Event>& events,
                            const WheelHypothesis& hypothesis);

/// Returns [events] the chance of rest in each event's collision, given what was measured before it; 0 for events of no
/// collision. @param events  wheel_events(measured)
std::vector<double> wheel_rest_chances(const WheelRuns& measured, const std::vector<Event>& events,
                                       const WheelHypothesis& hypothesis);

}  // namespace metastable::analysis
