#pragma once
// How likely a wheel's measured trials are under a hypothesis.

#include "analysis/diagnosis/transition_model.h"
#include "analysis/likelihood/wheel_hypothesis.h"
#include "analysis/likelihood/wheel_runs.h"

namespace metastable::analysis {

/// Log density and normal score of each of wheel_events(measured). The speed follows a SpeedFilter; a friction of each
/// trial's own is integrated by five Gauss-Hermite nodes.
/// @throws std::invalid_argument as dynamics::ExtendedWheel
Evaluation wheel_likelihood(const WheelRuns& measured, const std::vector<Event>& events,
                            const WheelHypothesis& hypothesis);

/// [events] The chance of rest after each event's collision, given what was measured before it; 0 for events of no
/// collision.
std::vector<double> wheel_rest_chances(const WheelRuns& measured, const std::vector<Event>& events,
                                       const WheelHypothesis& hypothesis);

}  // namespace metastable::analysis
