#pragma once
// Turns experiment.toml into data; toml++ stays inside experiment_toml.cpp.

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"
#include "dynamics/wheel/ranges.h"

namespace metastable::analysis {

/// Fills everything of `experiment` that experiment.toml says; all of its defects go to `defects`: not TOML, a key that
/// is missing, unknown, of the wrong type or out of range.
/// @param file name for messages
void parse_experiment_toml(const std::string& file, std::string_view text, Experiment& experiment, Defects& defects);

/// The model of a machine that its user brings.
inline constexpr const char* own_machine = "none";

/// Holds what experiment.toml says of walks: which built-in walker, and what is known of it and of its sensors.
struct WalkDescription {
  struct Column {
    std::string state;
    std::optional<double> sd;  ///< of its error; nothing: to be fitted
    double correlation = 0;    ///< of neighbouring rows' errors
  };
  std::string title, walker;
  std::string no_walker;            ///< line of the defect that no known walker is stated; empty: one is
  Spread slope_deg, slope_sd_deg;   ///< nominal value, and sd with which it is known
  std::vector<Column> columns;      ///< those that were measured
  std::vector<std::string> labels;  ///< columns of steps.csv: a crew, a floor
  std::vector<std::pair<std::string, Spread>> launches;  ///< states, with the mean and sd of first values; often none
};

/// Returns the range of what is measured of a walker, in steps.csv and as a launch.
dynamics::Range walk_column_range(std::string_view state);

/// Reads experiment.toml of walks, `system = "machine"`. Nothing where the file states another system, or none, and
/// where it is no TOML, which is a defect.
std::optional<WalkDescription> parse_walk_toml(const std::string& file, std::string_view text, Defects& defects);

/// Holds what experiment.toml says of a machine that its user brings, `model = "none"`: nothing has to be there.
struct MachineDescription {
  std::string title;
  std::vector<std::string> labels, inputs;                 ///< columns of steps.csv
  std::vector<std::pair<std::string, Spread>> parameters;  ///< nominal value, and sd with which it is known
  std::vector<WalkDescription::Column> columns;
};

/// Reads it. A file that states another system or model is a defect.
std::optional<MachineDescription> parse_machine_toml(const std::string& file, std::string_view text, Defects& defects);

}  // namespace metastable::analysis
