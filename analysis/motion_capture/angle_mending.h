#pragma once
// Mends what trackers and exports do to a wheel's angle (wraps, sign, repeated, lost and stray frames), or refuses it.

#include <string>
#include <vector>

#include "analysis/motion_capture/angle_file.h"

namespace metastable::analysis {

/// Bound the rates of cameras whose recordings are read [Hz].
inline constexpr double slowest_rate = 60, fastest_rate = 1000;

/// Estimates the white noise of samples [rad], by the smaller ones of their third differences: most stretches are
/// smooth over four samples. The step of their last digit counts as noise. O(samples)
double angle_noise(const std::vector<double>& angle);

/// Returns the recording at even times between its first frame and its last, linear between its frames; the recording
/// itself where its times are even to a hundredth of a frame.
AngleRecording evenly(const AngleRecording& recording);

struct MendedAngles {
  std::vector<MeasuredAngle> angles;
  std::vector<std::string> said;  ///< what was mended, a sentence each
};

/// Puts right, and says: times rounded to a last digit; angles wrapped at a turn, half a turn or a leg angle; angles
/// that fall as the wheel rolls; frames that repeat the one before, in the place of one that was lost or pushed in
/// between; frames that are left out in the numbering; single frames off the motion of their neighbours. Frames that
/// tell nothing are taken out, which leaves a gap in the times. Refused: angles that turn faster than any wheel of
/// these legs rolls, or so slowly that it could not come over a leg (the unit is suspected); jumps; more defects than a
/// tenth of a trial's frames.
/// @param file  for messages. @throws InputError, a line for each trial that cannot be mended. O(frames)
MendedAngles mend_angles(std::vector<MeasuredAngle> angles, const Experiment& description, const std::string& file);

}  // namespace metastable::analysis
