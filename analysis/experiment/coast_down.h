#pragma once
// Turns the log of a rotor's revolution counter into an experiment with system = "coast_down".

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/experiment_folder.h"

namespace metastable::analysis {

/// Holds the times at which the drum's counter rose.
struct CounterLog {
  std::string name;          ///< of the condition
  std::vector<double> time;  ///< [s], rising; a tick ends a revolution
  std::vector<int> skipped;  ///< by how much more than one the counter rose, a tick each
};

/// Reads a log without header: time [us], drum rim speed [km/h], drum revolutions, wheel speed [km/h], wheel
/// revolutions; a row whenever either counter rises. Speeds are read but not used.
/// @param file  for messages @throws InputError with the first 20 defects by line and column: other than five numbers,
///        time or counters that fall, counters that are no whole numbers; or fewer than 20 drum revolutions
CounterLog parse_counter_log(const std::string& file, std::string_view text);

struct CoastDownOptions {
  double stop = 5;  ///< ends below this speed [rad/s], > 0
  int block = 50;   ///< revolutions of a trial, 10..100000
  /// @throws std::invalid_argument naming the option and its range
  void validate() const;
};

struct Revolution {
  double time = 0;   ///< of its end [s]
  double omega = 0;  ///< its mean speed [rad/s]
};

struct CoastDownRun {
  std::string name;
  std::vector<std::vector<Revolution>> blocks;  ///< each without a gap, at least 10 revolutions
  double top = 0;                               ///< speed where it starts [rad/s]
  double stop = 0;                              ///< speed where it ends [rad/s]
  std::size_t revolutions = 0;                  ///< from the top to the stop
  std::size_t left_out = 0;                     ///< of those, in no block
  std::size_t missed = 0;                       ///< ticks that did not come: a period of two or more revolutions
  std::size_t doubled = 0;                      ///< ticks too many: a revolution in two parts
  std::size_t displaced = 0;                    ///< ticks early or late
};

/// Takes the revolutions from the last one within half a per cent of the top speed to the first below `stop`. A
/// period of 1.5 times the median of the eleven around it and more is a missed tick, one below 0.6 a double one;
/// periods off the line between their neighbours by more than eight robust standard deviations of the fifty around (and
/// 0.02 %) show a displaced one. Blocks end there and begin anew, so that no transition goes over a defect.
/// @param log  at least 10 ticks
/// @throws std::invalid_argument for fewer ticks, for skips that are not one a tick, if the top speed is not above
///         `stop`, or if no block remains
CoastDownRun coast_down(const CounterLog& log, const CoastDownOptions& options);

/// Holds the terms of the loss with their standard errors.
struct LossFit {
  RevolutionLoss loss;
  double constant_error = 0, linear_error = 0, quadratic_error = 0;
  std::size_t transitions = 0;
  std::size_t outliers = 0;  ///< beyond five noise_sd
};
/// Regresses robustly (Huber's, tuned to 95 % efficiency) the loss of omega^2 on 1, omega (if `linear`) and omega^2;
/// noise_sd comes from the median absolute residual.
/// @throws std::invalid_argument for fewer than 20 transitions
LossFit fit_loss(const std::vector<CoastDownRun>& runs, bool linear);

/// Returns what keeps a run from being a basis for anything: more than a tenth of its revolutions left out, a loss
/// that is not positive over its speeds, or speeds that no drum has. "" where nothing does.
std::string objection(const CoastDownRun& run, const RevolutionLoss& nominal);

/// Returns by how much the loss differs between runs of one drum: an sd, as a share of the loss, over the speeds that
/// all of them had. One more difference of usual_run_to_run is counted, because runs are few.
/// @param runs  two or more @param linear  as for fit_loss
/// @throws std::invalid_argument as fit_loss, and for runs that differ by more than an experiment may state
double run_to_run_of(const std::vector<CoastDownRun>& runs, bool linear);

/// Returns the folder: one condition a run, blocks as trials in their order.
ExperimentFiles coast_down_files(const std::vector<CoastDownRun>& runs, const RevolutionLoss& nominal,
                                 std::optional<double> rotor_inertia, const std::string& title,
                                 const std::vector<std::string>& comment);

}  // namespace metastable::analysis
