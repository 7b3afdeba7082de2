#pragma once
// Reads input files that options name.

#include <filesystem>
#include <string>

namespace metastable::reports {

/// Returns the whole of a file or a pipe; waiting for a pipe ends at Ctrl-C.
/// @throws std::invalid_argument "PATH: cannot be read", for a folder and a device too; Interrupted (interrupt.h)
std::string read_file(const std::filesystem::path& path);

}  // namespace metastable::reports
