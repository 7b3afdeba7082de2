#pragma once
// Draws trials of a wheel under a hypothesis, in the design of a measured experiment.

#include <cstdint>
#include <vector>

#include "analysis/wheel_model/wheel_hypothesis.h"
#include "analysis/wheel_model/wheel_runs.h"

namespace metastable::analysis {

/// Draws each run anew: launches from the stated spread (else from the measured first speed), as many collisions as
/// were measured at most (16 or more if the measured run came to rest), reported with sensor noise. Same seed, same
/// runs.
/// @throws std::invalid_argument as dynamics::ExtendedWheel
std::vector<WheelRun> simulated_runs(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed);

/// Finds expected steps before failure as steps over summed probabilities of rest, along four times the design's
/// trials: infinity where it never rests. @throws std::invalid_argument as dynamics::ExtendedWheel
double simulated_steps(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed);

}  // namespace metastable::analysis
