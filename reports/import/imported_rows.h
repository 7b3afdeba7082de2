#pragma once
// Holds what a foreign file tells, collision by collision, step by step or camera frame by camera frame, with the place
// of each.

#include <optional>
#include <string>
#include <vector>

namespace metastable::reports {

/// Numbers are in SI; what the file does not tell is nothing. Of walks, `collision` is the step and `leg` the phase.
struct ImportedRow {
  std::string place;  ///< in the file, for messages: "data.csv:12", "data.mat: trials(3).omega(2)"
  std::optional<std::string> condition = {}, trial = {}, outcome = {};
  std::optional<double> collision = {}, leg = {}, time = {}, position = {}, omega_minus = {}, omega_plus = {},
                        angle = {}, half_angle = {}, stance_rate = {}, swing_rate = {};
};

}  // namespace metastable::reports
