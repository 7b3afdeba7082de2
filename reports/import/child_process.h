#pragma once
// Runs in a process of its own what other people's files may bring down.

#include <functional>
#include <string>

namespace metastable::reports {

/// Returns what `work` returns, run in a child process: a crash of it, endless work (two minutes of CPU time) or too
/// much memory (4 GiB more than there is) end the child alone. What it prints is dropped.
/// @throws std::invalid_argument with the text of the std::exception that `work` throws, or `died` with the signal or
///         code by which it ended; Interrupted
std::string in_child_process(const std::function<std::string()>& work, const std::string& died);

}  // namespace metastable::reports
