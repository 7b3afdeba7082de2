#pragma once
// The measured trials of a machine, row by row.

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"

namespace metastable::analysis {

enum class MachineOutcome { failed, stopped, lost };

/// The measured values between two steps. NaN stands for a value that is missing.
struct MachineRow {
  std::vector<double> seen;                                    ///< [Machine::observe]
  double time = std::numeric_limits<double>::quiet_NaN();      ///< [s] by one clock for all trials
  double position = std::numeric_limits<double>::quiet_NaN();  ///< [m]
  int phase = -1;                                              ///< index of MachineRuns::phases; -1: none
  std::vector<int> labels = {};                                ///< by label: index of its value; -1: none
  std::vector<double> inputs = {};                             ///< [Machine::inputs] of the step from this row on
};

struct MachineTrial {
  std::size_t condition = 0;
  std::optional<MachineOutcome> outcome = {};  ///< nothing: not known
  std::vector<MachineRow> rows;                ///< row k is the state after k steps
  std::string name = {};                       ///< as its user calls it; empty: by its number, from 1
};

/// Counts the steps of a trial: to each row from the one before, and one more into failure.
std::size_t steps_of(const MachineTrial& trial);

/// A column of labels: a crew, a floor, a controller.
struct MachineLabel {
  std::string name;
  std::vector<std::string> values;
};

struct MachineRuns {
  std::vector<std::string> conditions = {"all"};
  std::vector<std::string> phases;  ///< names, in order; empty: not known
  std::vector<MachineLabel> labels;
  std::vector<MachineTrial> trials;  ///< in the order they were run

  std::size_t transitions() const;               ///< from one row to the next, in all trials
  std::size_t longest() const;                   ///< rows of the longest trial
  bool timed() const;                            ///< every row has its time
  bool placed() const;                           ///< every row has its position
  std::string name_of(std::size_t trial) const;  ///< for messages: MachineTrial::name, or its number
};

/// Says whether a trial begins a step after the one before it ended, by a clock that goes on: one run was cut there.
bool goes_on(const MachineRuns& runs, std::size_t trial);

/// The place of a row.
struct RowPlace {
  std::size_t trial, row;
};
/// Returns where an input is found that was recorded some rows before a row: in its trial, in the trial before where
/// the trial goes on with that, else in its first row.
RowPlace row_before(const MachineRuns& runs, std::size_t trial, std::size_t row, std::size_t steps);

/// The mean and the standard deviation of the values that a sensor has in all rows; mean 0 and sd 1 without a value.
struct ColumnSpread {
  double mean = 0, sd = 1;
};
ColumnSpread column_spread(const MachineRuns& runs, std::size_t sensor);

/// Returns every n-th trial, so that about `steps` steps are left, or all.
MachineRuns thinned(const MachineRuns& runs, std::size_t steps);

/// The runs as they would be had their user misread a column.
struct MisreadRuns {
  std::string change;    ///< what was changed, as the beginning of a sentence
  std::string question;  ///< to be asked where the machine fits these runs better
  MachineRuns runs;
};

/// Returns the runs with each sensor and each input one row later and one row earlier, with its sign the other way
/// round where it has both, with each input in another unit, and with the rows of every trial in the opposite order.
/// Rows that are left without a value go, and trials do that have fewer than three rows, or lack a state in the first
/// of them or an input before the last.
std::vector<MisreadRuns> misread_runs(const Machine& machine, const MachineRuns& runs);

/// Lists in sentences the signs that the runs are not this machine's: columns in other units, in all trials or in some;
/// a column that is constant in some trials, an input that is in all; trials that are there twice; first rows whose
/// mean is four standard errors and more off the launch that is stated; steps without a phase; rows that are missing
/// where the step is not told of the gaps.
/// @throws std::invalid_argument where they do not fit the machine: no transition, fewer rows than parameters, rows of
///   another shape, time that runs back within a trial, a label "machine" with two values, a state that is constant, a
///   first row that lacks a state without launch; where the map makes something else of the same rows when it is asked
///   again
std::vector<std::string> look_over(const Machine& machine, const MachineRuns& runs);

}  // namespace metastable::analysis
