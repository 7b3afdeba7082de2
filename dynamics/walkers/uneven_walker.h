#pragma once
// Steps walkers of two legs that may differ, with what real ones have and the ideal ones lack: a hip that resists,
// strikes that take more, feet that slip.

#include <cstdint>
#include <span>

#include "dynamics/walkers/leg_motion.h"

namespace metastable::dynamics {

/// Holds one leg: a mass at a point of it.
struct WalkerLeg {
  double mass = 5;            ///< [kg], > 0
  double foot_to_mass = 0.5;  ///< [m], >= 0
  double mass_to_hip = 0.5;   ///< [m], > 0
  double length() const { return foot_to_mass + mass_to_hip; }
};

/// Holds a walker as it begins a step.
struct UnevenWalker {
  WalkerLeg stance, swing;
  double hip_mass = 10;     ///< [kg], >= 0
  double gravity = 9.81;    ///< [m/s^2], > 0
  double hip_damping = 0;   ///< [N m s/rad], the torque on each leg a rate of turning against the other
  double hip_friction = 0;  ///< [N m], of constant size against that turning, >= 0
  double impact_loss = 0;   ///< share of the energy after a plastic strike that the strike takes, too, < 1
  double foot_slip = 0;     ///< [m] by which the struck foot slips on, away from the other, as it is loaded
};

/// Takes one step of each walker: state i, half the angle between the legs [rad], stance rate and swing rate [rad/s] as
/// in Stride, stands at states[3 i] with both feet on the ground, meets a plane of slopes[i] [rad] and leads to next[3
/// i], in which the legs have changed their parts; or fell[i] is 1, as of TwoLinkWalker::step, and where the half angle
/// is not between 0 and pi/2. Strikes keep the angular momenta of the walker about the struck foot and of the new swing
/// leg about the hip. A friction that would hold the legs still for a moment lets them pass.
void step_uneven(std::span<const UnevenWalker> walkers, std::span<const double> states, std::span<const double> slopes,
                 std::span<double> next, std::span<std::uint8_t> fell);

}  // namespace metastable::dynamics
