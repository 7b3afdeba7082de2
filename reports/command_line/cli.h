#pragma once
// The command line: parses, calls, and turns failures into exit codes.

namespace metastable::reports {

/// Exit codes: 0 done; 2 wrong option, key, value or file, or an output that cannot be written (one line on standard
/// error); 3 a computation failed: a solver, memory, a program that is not there; 130 or 143 interrupted.
int run(int argc, const char* const* argv);

}  // namespace metastable::reports
