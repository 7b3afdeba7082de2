#pragma once
// Defines one command of the command line: its options, and its request from them.

#include <functional>
#include <string>
#include <vector>

#include "reports/command_line/options.h"

namespace metastable::reports {

struct Command {
  std::string name, summary;
  std::function<void(Options&)> declare;
  std::function<void(const Options&, const std::string& command_line)> run;
  std::string details = {};                ///< below the options in --help and on the manual page
  std::vector<std::string> examples = {};  ///< before them: lines for the shell, to be pasted as they stand
};

/// Makes import.
Command import_command();

/// Makes blind.
std::vector<Command> blind_commands();
/// Makes simulate, collisions, describe, diagnose, effects, study and others: the commands about experiments.
std::vector<Command> experiment_commands();

}  // namespace metastable::reports
