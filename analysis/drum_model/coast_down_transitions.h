#pragma once
// Models a rotor coasting down, revolution by revolution: the second system that the diagnosis knows.

#include <memory>

#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Takes omega^2 of the next revolution = omega^2 - (constant + linear omega + quadratic omega^2) + noise, the losses
/// as stated in experiment.toml, the noise normal. Recalibration refits, within what is physical: the three losses (a
/// few per cent from run to run), the noise, a jitter of the counter's clock and of its marks, a share of revolutions
/// that the counter garbled, a loss that wanders along a run, and more loss around one speed where the rig rings.
/// Effects: rolling_resistance (a constant torque: loss 4 pi T / I a revolution), axle_drag_viscous, air_drag,
/// contact_memory, trial_drift (of the constant loss, where trials are runs of their own), contact_outliers (rare
/// revolutions with a loss several times the noise), sensor_noise, sensor_bias. Without a stated inertia torques are
/// those of 1 kg m^2; notes() says so.
/// @throws std::invalid_argument for a rimless wheel, and for an experiment without a transition
std::unique_ptr<TransitionModel> coast_down_transitions(const Experiment& experiment);

}  // namespace metastable::analysis
