#pragma once
// The place, time, phase and order in which each step of a machine was taken: the quantities on which an effect of any
// machine may depend.

#include <cstddef>
#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// The place of one step. NaN or -1: not known.
struct StepPlace {
  std::size_t trial = 0;
  int number = 1;            ///< in its trial, from 1
  double run = 0;            ///< place of its trial in the order of runs, -1/2 to 1/2
  double time = 0;           ///< [s]
  double position = 0;       ///< [m]
  int phase = -1;            ///< index
  std::vector<int> labels;   ///< index of each label's value
  std::vector<double> seen;  ///< [sensors] before the step, in sds of its column from the mean; 0 where it is missing
  /// [inputs x input_lags] of this step and of the steps before, likewise.
  std::vector<double> inputs = {};
};

/// Says how an input goes along.
struct InputCourse {
  bool code = false;     ///< it has no unit, and takes few values, all whole: there is nothing between them
  bool by_phase = true;  ///< it is the same wherever the phase is
  bool changes = false;  ///< it changes within a trial
};

inline constexpr std::size_t trials_of_a_spread = 5;  ///< So many tell what differs from trial to trial.
inline constexpr std::size_t input_lags = 3;  ///< steps of which StepPlace::inputs holds the inputs: 0, 1 and 2 before

/// The values that a sensor has in the first rows of trials.
struct FirstValues {
  std::size_t count = 0;
  double mean = 0, sd = 0;
};

/// All steps of the runs, in the order in which MachineHypothesis numbers them, and what they cover.
struct MachineDesign {
  std::vector<StepPlace> steps;
  std::size_t trials = 0;
  std::vector<std::string> phases;  ///< MachineRuns::phases
  std::vector<MachineLabel> labels;
  bool timed = false, placed = false;
  double first_time = 0, last_time = 0, usual_gap = 0;  ///< [s]; the median time of a step
  double first_position = 0, last_position = 0;         ///< [m]
  std::vector<double> mean, sd;                         ///< by sensor, of its column
  std::vector<double> change;                           ///< by sensor: sd of its change from row to row
  std::vector<double> usual_change;                     ///< by sensor: root mean square of that change
  std::vector<double> along_order;  ///< by sensor: correlation of its column with the order of trials
  std::vector<FirstValues> first;   ///< by sensor
  std::vector<bool> goes_on;        ///< by trial: goes_on() of machine_runs.h
  std::vector<InputCourse> inputs;
};

MachineDesign machine_design(const Machine& machine, const MachineRuns& runs);

/// Returns by step how far a state that the map lacks is ahead of a measured one that it follows: it takes on a share
/// 1 - kept of their distance at each step. It begins at that state, or where it was when the trial goes on with the
/// one before; a value that is missing leaves it where it is.
std::vector<double> ahead_of(const MachineDesign& design, std::size_t sensor, double kept);

/// Returns the share of the variance of a number of each step that neither a cubic of a measured state, a line of the
/// others nor, from five trials on, the number of the step has.
double share_beside_states(const MachineDesign& design, std::size_t sensor, const std::vector<double>& number);

/// Says in a sentence why a machine whose inputs were recorded tells no expected steps, "" where no input changes
/// within a trial but by the phase: a simulation would replay the inputs, which a machine that is held by feedback does
/// not.
std::string replayed_inputs(const Machine& machine, const MachineDesign& design);

/// Asks, in a sentence, about trials that are there twice, number by number. Empty: there are none.
std::vector<std::string> doubled_trials(const MachineRuns& runs);

/// Asks, in a sentence for each sensor, about values that lie far from the rows before and behind them: beyond three
/// times what the column spans between its percents 1 and 99.
/// @throws std::invalid_argument for marks of missing values (99, -999, 9999 and the like) beyond twenty times that
std::vector<std::string> far_values(const Machine& machine, const MachineRuns& runs);

/// Asks, in a sentence each, about sensors whose values seem to wrap: they stay within a turn (2 pi, or 360) and jump
/// by about one from row to row. Slopes of the map across such a jump are wrong.
std::vector<std::string> wrapping_columns(const Machine& machine, const MachineRuns& runs);

/// Asks, in a sentence, for launches that are neither stated nor seen: the first values of trials scatter little beyond
/// the error of their sensor. Trials would be taken to begin where that error put them. Empty: there are none.
std::string unseen_launches(const Machine& machine, const MachineRuns& runs);

/// Asks all of these about the measured values, but that of doubled trials; and about a number that is there again and
/// again, off the rows beside it (0 and -1 of a sensor that rounds, too), and rows that repeat the row before, where
/// values are hardly there twice otherwise.
std::vector<std::string> questions_on_values(const Machine& machine, const MachineRuns& runs);

/// Returns a number for every step.
template <class Of>
std::vector<double> by_step(const MachineDesign& design, Of of) {
  std::vector<double> all;
  all.reserve(design.steps.size());
  for (const StepPlace& place : design.steps) all.push_back(of(place));
  return all;
}

}  // namespace metastable::analysis
