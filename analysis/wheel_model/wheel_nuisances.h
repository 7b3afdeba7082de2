#pragma once
// Says what a recalibration refits of a wheel, each in a slot of its own of the model's list of nuisances.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/wheel_hypothesis.h"
#include "dynamics/step_density/collision_density.h"

namespace metastable::analysis {

/// Says where each nuisance stands in the list. Spreads and ratios are refitted by their logarithms; log_noise_sd is
/// there only where the noise is refitted, the last six only under `settled`, of which the noise has its slot behind
/// the others.
struct WheelSlot {
  enum : std::size_t {
    restitution_mean,
    log_restitution_sd,
    friction_mean,
    log_friction_sd,
    skew,
    tails,
    log_noise_sd,
    log_hub_inertia_ratio = log_noise_sd,
    log_sticking_ratio,
    log_plus_ratio,
    log_next_ratio,
    next_by_slope,
    log_settled_noise_sd
  };
};

/// Contacts that are stated to scatter by this sd or more are not fitted as scattering by less than half of it; the
/// others are, down to what the noise hides.
inline constexpr double least_scatter = 0.01;

/// Returns the contact as it is stated, with sds that are not 0: one stated to be constant scatters by so little that
/// the noise hides it. @param noise  sd of reported speeds [rad/s]
dynamics::ContactSpread stated_contact(const NominalContact& nominal, double noise);

/// @param noise  sd of reported speeds to start from, where it is refitted [rad/s]
/// @param seen  sd of reported speeds, refitted or not [rad/s]; where it is not known every contact scatters by 0.01
std::vector<Nuisance> wheel_nuisances(const NominalContact& nominal, std::optional<double> noise,
                                      std::optional<double> seen = {});

/// Says what these values of the nuisances suppose of the wheel, without effects.
WheelHypothesis hypothesis_at(std::span<const double> nuisance);

/// Sets the slots of the contact; the others keep their values.
void set_contact(std::vector<double>& nuisance, const dynamics::ContactSpread& contact);

}  // namespace metastable::analysis
