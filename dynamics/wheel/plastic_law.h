#pragma once
// McGeer's wheel neither slips nor rebounds.

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

/// Returns the losses of a collision after which the foot rests and sticks [J], any sign of u0. For a rolling wheel
/// omega+ = omega- (L1 L2 cos(alpha) + r_g^2)/(L2^2 + r_g^2); `jammed` where that is negative (few, long legs).
/// The work of the contact impulse is split into its normal and tangential parts; only the sum has a meaning. O(1).
Loss plastic_loss(const ContactModel& model, const Collision& collision);

}  // namespace metastable::dynamics
