#pragma once
// The scores in which a machine's map is nonlinear, and those by which it fails.

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Scores that are taken by a lattice, at most two, and the one along which the edge of failure is sought, one of them.
/// All others are taken as straight: what they add to the next state is normal.
struct ScorePlan {
  std::vector<std::size_t> lattice;
  std::optional<std::size_t> failing;
  bool others_fail = false;  ///< scores that are taken as straight lead to failure, too
};

/// Says that the map fails at zero scores from most rows that went on.
class FailsFromMostRows : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Finds out where the map bends by more than one part in a thousand of its slope, at every measured row, and whether
/// it fails within four and a half sds of its scores or did fail.
/// @param nominal  without spreads and memory: a measured row is all of a point
/// @throws std::invalid_argument for a hypothesis with these, where the map returns no finite state from a measured
///   row  @throws FailsFromMostRows where it fails from most of them
ScorePlan score_plan(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& nominal);

}  // namespace metastable::analysis
