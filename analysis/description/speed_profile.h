#pragma once
// Gives the speeds before collisions, trial by trial, and what is usually said of them.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "dynamics/return_map/trials.h"

namespace metastable::analysis {

/// Holds the speeds just before collisions 1, 2, ... [rad/s], one list a trial.
using TrialSpeeds = std::vector<std::vector<double>>;

/// Takes the trials of one condition. @throws std::invalid_argument for an index out of range
TrialSpeeds speeds(const Experiment& experiment, std::size_t condition);
TrialSpeeds speeds(const std::vector<dynamics::Trial>& trials);

/// The first collision of the steady state: the paper compares beyond the 12th.
constexpr int steady_collision = 13;

struct SpeedSummary {
  std::size_t count = 0;
  double mean = 0;            ///< [rad/s]
  double sd = 0;              ///< between the values [rad/s]; 0 for fewer than two
  double standard_error = 0;  ///< of the mean, sd / sqrt(count)
};
SpeedSummary speed_summary(std::span<const double> values);

/// Returns the speeds at collision `number` (from 1) of the trials that got there.
std::vector<double> at_collision(const TrialSpeeds& trials, int number);
/// Returns a list whose entry k is collision k + 1, up to the longest trial.
std::vector<SpeedSummary> speed_profile(const TrialSpeeds& trials);

/// Return the speeds from collision `from` on: all of them, and the mean of each trial that got there (one a trial:
/// independent).
std::vector<double> steady_speeds(const TrialSpeeds& trials, int from = steady_collision);
std::vector<double> steady_trial_means(const TrialSpeeds& trials, int from = steady_collision);

/// Returns the speed at each leg from collision `from` on: the mean over trials of the trial's mean where that leg
/// lands. Entry i is leg i; nothing if the legs of some collision are not known.
std::optional<std::vector<SpeedSummary>> speed_per_leg(const Experiment& experiment, std::size_t condition, int from);

/// Fits a straight line to the pairs (omega_k, omega_k+1) from collision `from` on.
struct ReturnMapLine {
  std::size_t pairs = 0;
  double slope = 0, slope_error = 0;  ///< standard error, allowing for dependence within trials (sandwich)
  double intercept = 0;               ///< [rad/s]
  std::optional<double> fixed_point;  ///< where it meets the diagonal [rad/s]; nothing for slope 1
  double residual_sd = 0;             ///< of omega_k+1 about the line [rad/s]
};
/// Returns nothing for fewer than three pairs or equal speeds.
std::optional<ReturnMapLine> return_map_line(const TrialSpeeds& trials, int from);

}  // namespace metastable::analysis
