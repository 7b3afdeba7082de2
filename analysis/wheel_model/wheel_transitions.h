#pragma once
// The rimless wheel's measured trials become transitions.

#include <memory>

#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Returns wheel_runs() of an experiment; legs that were neither noted nor found are counted from each condition's
/// first_landing_leg: where it is stated unless the transitions contradict it, else where they bear it out.
/// @throws std::invalid_argument as wheel_runs()
WheelRuns runs_with_legs(const Experiment& experiment);

/// Names of what TransitionModel::elsewhere() knows of a wheel: the slope [deg], and omega- of the launch [rad/s].
inline constexpr const char *other_slope = "at-slope", *other_launch = "at-speed";

/// The model gives one-step densities of the wheel's trials under the nominal law with its (eta, mu) and the
/// catalogue's effects. With omega_plus, collision and stance are separate events; sensor noise is carried along by a
/// Gaussian filter on the speed (exact while the noise is small beside the spread of a collision). Recalibration refits
/// the contact's means and sds and a smooth change of shape (ScoreTilt). What was not measured is completed as
/// wheel_runs() says.
/// @throws std::invalid_argument for a coast-down and for an experiment without a transition
std::unique_ptr<TransitionModel> wheel_transitions(const Experiment& experiment);

}  // namespace metastable::analysis
