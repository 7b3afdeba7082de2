#pragma once
// Turns experiment.toml into data; toml++ stays inside experiment_toml.cpp.

#include <string>
#include <string_view>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"

namespace metastable::analysis {

/// Fills everything of `experiment` that experiment.toml says; all of its defects go to `defects`: not TOML, a key that
/// is missing, unknown, of the wrong type or out of range.
/// @param file name for messages
void parse_experiment_toml(const std::string& file, std::string_view text, Experiment& experiment, Defects& defects);

}  // namespace metastable::analysis
