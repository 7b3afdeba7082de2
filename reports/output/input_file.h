#pragma once
// Input files that options name.

#include <filesystem>
#include <string>

namespace metastable::reports {

/// The whole of a file. @throws std::invalid_argument "PATH: cannot be read", for a folder too
std::string read_file(const std::filesystem::path& path);

}  // namespace metastable::reports
