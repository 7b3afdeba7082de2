#pragma once
// Reads steps.csv and trials.csv: the rows of any machine's trials, and how these ended.

#include <string>
#include <utility>
#include <vector>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// The columns of steps.csv beside condition, trial, step, phase, time_s and position_m.
struct StepColumns {
  std::vector<std::pair<std::string, dynamics::Range>> states;  ///< measured, each with the range of its values
  /// Labels are those that experiment.toml lists; behind them come others that the call names.
  std::vector<std::string> labels = {}, labels_of_call = {}, inputs = {};
  bool legs = false;          ///< phases are legs, 1 and 2, which take turns where both are named; else any words
  bool leg_is_input = false;  ///< the leg is an input of the step
};

/// Says what is wrong with names of labels: one that is empty, there twice, or the name of another column; empty:
/// nothing.
std::string label_objection(const std::vector<std::string>& labels, const StepColumns& columns);

/// Checks names and types of the columns, steps of a trial in order without gap, legs that take turns, trials that
/// stand together, and outcomes of those trials only. Values of labels and phases have the order in which they come.
/// Each defect goes to `defects`, with file, line and column.
/// @param source  with the texts of both files; trials.csv may be missing
void read_steps(const ExperimentSource& source, const StepColumns& columns, MachineRuns& runs, Defects& defects);

}  // namespace metastable::analysis
