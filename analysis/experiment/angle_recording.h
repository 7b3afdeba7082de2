#pragma once
// Records what a camera sees of a simulated trial: the wheel's angle over time (angle.csv).

#include <cstdint>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/study/setting.h"
#include "dynamics/return_map/trials.h"

namespace metastable::analysis {

/// Holds the unwrapped angle of the wheel, rising as it rolls down, at rising times [s].
struct AngleRecording {
  std::vector<double> time, angle_rad;
};

inline constexpr double recorded_after_rest_s = 0.3;  ///< of a wheel that has come to rest [s]

struct CameraOptions {
  double rate = 120;             ///< frames per second [Hz], [10, 100000]
  double noise_sd_rad = 0.0002;  ///< white noise of the angle, >= 0
  int decimals = 9;              ///< of the angle in angle.csv, 1..15
  std::uint64_t seed = 1;
  int threads = 0;  ///< the same bits on any number
  markov::Share progress = {};
  /// @throws std::invalid_argument naming the option and its range
  void validate() const;
};

/// Returns trial `index` as recorded: the angle is 0 and the time 0 at collision 1. It begins in the stance before
/// collision 1 (at most 0.3 s before; a wheel too slow to have come over its foot was held until its release) and ends
/// before the collision after the last one; a wheel that came to rest falls back onto both feet and lies still for 0.3
/// s. The first frame falls at random between two ticks of the trial's clock.
AngleRecording record_angle(const dynamics::WheelMap& map, const dynamics::Trial& trial, const CameraOptions& options,
                            std::uint64_t index);

/// Returns angle.csv of all trials, as text; trials are numbered through all conditions.
std::string angle_csv(const std::vector<SimulatedCondition>& conditions, const CameraOptions& options);
/// Does the same for one condition, whose id is its slope.
std::string angle_csv(const Setting& setting, const std::vector<dynamics::Trial>& trials, const CameraOptions& options);

}  // namespace metastable::analysis
