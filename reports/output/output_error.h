#pragma once
// An output that cannot be written.

#include <filesystem>
#include <stdexcept>
#include <string>

namespace metastable::reports {

/// The message names the path and the reason. A user error: exit code 2.
class OutputError : public std::invalid_argument {
 public:
  OutputError(const std::filesystem::path& path, const std::string& reason)
      : std::invalid_argument("cannot write " + (path.empty() ? std::string("''") : path.string()) + ": " + reason) {}
};

}  // namespace metastable::reports
