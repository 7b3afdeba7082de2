#pragma once
// Draws runs of a machine.

#include <cstdint>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Says where trials that are drawn begin.
enum class Launches {
  measured,  ///< at the measured first rows, less an error drawn anew
  stated     ///< where the launch of a state is stated, at values drawn from that; else as above
};

/// Draws the same design (trials, columns, what is missing) under a hypothesis. A trial that failed may go on to the
/// length of the longest. The same seed gives the same data.
MachineRuns simulate_machine(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                             std::uint64_t seed, Launches launches = Launches::measured);
/// Draws several experiments, each as simulate_machine() does by its seed; the map is called once a step number for
/// all.
/// @param experiments  at least one: the same design, launches apart
std::vector<MachineRuns> simulate_machines(const Machine& machine, std::span<const MachineRuns> experiments,
                                           const MachineHypothesis& supposed, std::span<const std::uint64_t> seeds,
                                           Launches launches = Launches::measured);

/// Draws first rows anew, as likely as the measured ones of trials with the same condition, phase, labels and columns:
/// from their smoothed distribution (SmoothSample), of which the errors of the sensors are no part once
/// simulate_machine() has taken them off. Nothing but the first rows differs.
MachineRuns smoothed_launches(const MachineRuns& runs, const MachineHypothesis& supposed, std::uint64_t seed);

/// Draws the launches that the distribution may be known by instead, among those with the same condition, phase, labels
/// and columns (reflected_bootstrap()): as far as so many trials leave it open.
MachineRuns redrawn_launches(const MachineRuns& runs, std::uint64_t seed);

/// Steps that were taken, and those of them that failed.
struct CountedSteps {
  double steps = 0, failed = 0;
};

/// Counts failures in the experiment drawn again and again, with smoothed launches, until 300 came or 30,000 steps were
/// taken: 6 % of error.
CountedSteps counted_failures(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                              std::uint64_t seed);

}  // namespace metastable::analysis
