#pragma once
// Follows a machine's trials row by row: the density of each measured value given those before it.

#include <cstddef>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"
#include "analysis/machine_model/score_lattice.h"

namespace metastable::analysis {

/// Lists the events of the runs: the values of each row after the first, sensor by sensor, and failures and survivals;
/// those of the first row of a trial that takes a step where a launch is stated, as EventKind::launch.
std::vector<Event> machine_events(const Machine& machine, const MachineRuns& runs, const ScorePlan& plan);

/// Evaluates them. The state given what was measured is carried as one normal, jointly with what differs between
/// trials, the scores before and the errors shared by neighbouring rows; its step is exact for linear maps and of
/// second order in the state for others, and a lattice takes the scores in which a map bends. All trials go together:
/// the map is called once a step number, once more where a polynomial does not tell a lattice from some of its points,
/// and a dozen times more where trials may fail.
/// @param events  machine_events() of the runs
/// @param chances  where given, filled with the probability of failure in each event's step [events]
Evaluation follow_machine(const Machine& machine, const MachineRuns& runs, const ScorePlan& plan,
                          const std::vector<Event>& events, const MachineHypothesis& supposed,
                          std::vector<double>* chances = nullptr);

}  // namespace metastable::analysis
