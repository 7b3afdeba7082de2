#pragma once
// Reads angle.csv of an experiment folder.

#include <cstddef>
#include <vector>

#include "analysis/experiment/angle_recording.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Holds the recording of one trial.
struct MeasuredAngle {
  int number = 0;             ///< of the trial
  std::size_t condition = 0;  ///< index
  AngleRecording recording;
};

/// Reads source.angle_csv strictly. Checked besides types and names: two frames or more a trial, times rising by one
/// frame at a time (within a quarter of the trial's median interval), a trial of one known condition only, the same
/// trials as in trials.csv if that is there. By rising trial number. O(rows log rows)
/// @param description  of the same folder, from parse_description()
/// @throws InputError with the first 20 defects, each with file, line and column
std::vector<MeasuredAngle> parse_angles(const ExperimentSource& source, const Experiment& description);

}  // namespace metastable::analysis
