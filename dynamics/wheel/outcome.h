#pragma once
// Says how a trial ends.

namespace metastable::dynamics {

enum class Outcome { rest, end_of_ramp, max_collisions };

}  // namespace metastable::dynamics
