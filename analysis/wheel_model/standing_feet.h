#pragma once
// Says which landed feet stand before the next one touches, so that the law `settled` holds of them.

#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Says whether a foot stands with nearly any restitution that is assumed: up to LandingShares::Leg::settles_below.
/// @param measured  with landings
bool stands_at_any_restitution(const WheelRuns& measured, const WheelRun& run, const RunCollision& m);

/// Finds legs with more restitution than speeds at which feet stand are taken for (WheelRuns::springing), notes them
/// and tabulates landings anew: hardly a landing of theirs has less, where many of the other legs' have. Feet that
/// slide hide what they have, so that a leg with too little friction to stick is taken for one, which leaves out what
/// follows its slides. Nothing is found without landings, legs or omega+.
void find_springing_legs(WheelRuns& measured);

/// Marks the collisions for which the law `settled` holds: slow enough that the landed foot stands before the next one
/// touches, as the one before was. Where restitution varies so much that few are, omega+ tells: a foot stands if it
/// does with the largest restitution that can have left it so fast, that of a foot that sticks. A first impact then
/// counts if the foot before stood, and what follows it if its own does, too. Both go by what was seen before, so that
/// they choose no outcomes. So it is with legs that spring more than the others. Under other laws all count.
void mark_counted(const WheelRuns& measured, WheelRun& run);

}  // namespace metastable::analysis
