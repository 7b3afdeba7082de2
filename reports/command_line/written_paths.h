#pragma once
// What a command writes is no other file of it.

#include <string>

#include "reports/command_line/options.h"

namespace metastable::reports {

/// Checks that the file of --json is none that the command reads or writes by another option, and where it lies in a
/// folder of the command its name ends in .json, so that it replaces no table, figure or data there. A file of --out is
/// none that is read.
/// @param config  the file of --config, "" for none
/// @throws std::invalid_argument naming both options
void check_written_paths(const Options& options, const std::string& config);

}  // namespace metastable::reports
