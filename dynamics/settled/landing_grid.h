#pragma once
// Fills the coarse grid of landings that likelihoods read.

#include <functional>
#include <memory>

#include "dynamics/settled/landing_shares.h"
#include "dynamics/settled/settled_wheel.h"
#include "dynamics/step_density/collision_density.h"

namespace metastable::dynamics {

/// LandingShares::Leg::settles_below is that at the nominal mean restitution plus so many sds.
inline constexpr double settling_sds = 2;

/// Makes the landings of this wheel on its slope, each followed. Some 70,000 of them take 2 to 3 s.
/// @param slowest, fastest  speeds omega- to be read [rad/s], 0 < slowest < fastest
/// @param contact  nominal: LandingShares::Leg::settles_below is that at its mean restitution plus settling_sds; speeds
///        above it are not tabulated unless every one is asked for, nor restitutions beyond four sds
/// @param every_speed  tabulates speeds up to the fastest all the same
/// @param settling  says up to which restitution feet stand
/// @param executor  calls the work for every index in [0, count), in any order, from any threads; none: in order
/// @throws std::invalid_argument as SettledWheel::validate()
std::shared_ptr<const LandingShares> landing_grid(
    const SettledWheel& wheel, double slowest, double fastest, const ContactSpread& contact,
    const std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>& executor = {},
    bool every_speed = false, bool settling = false);

}  // namespace metastable::dynamics
