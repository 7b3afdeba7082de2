#pragma once
// Runs the command line: parses, calls, and turns failures into exit codes.

#include <functional>
#include <string>
#include <vector>

#include "reports/command_line/command.h"

namespace metastable::reports {

/// Returns the exit code: 0 done; 2 wrong option, key, value or file, or an output that cannot be written (one line on
/// standard error); 3 a computation failed: a solver, memory, a program that is not there; 130 or 143 interrupted.
int run(int argc, const char* const* argv);

/// A program of commands of its own, parsed and ended in the same way.
struct Program {
  std::string name, summary;
  std::vector<Command> commands;
  bool silent = false;  ///< says nothing of failures: another process does
};
int run(const Program& program, int argc, const char* const* argv);

/// Makes sweep; with `sharing`, its points are shared with other processes.
Command sweep_command(const struct Sharing* sharing = nullptr);

}  // namespace metastable::reports
