#pragma once
// Reads options from a TOML file.

#include <filesystem>
#include <string>
#include <vector>

namespace metastable::reports {

/// One key of a configuration file with its value(s) as the command line would spell them.
struct ConfigEntry {
  std::string key;
  std::vector<std::string> values;  ///< an array gives several
  int line = 0;
};

/// Reads a TOML file of plain keys: strings, numbers, booleans, and arrays of these (an array inside an array becomes a
/// comma list, so initial-speed = [[7.35, 0.19], [5.83, 0.28]] is two values).
/// @throws std::invalid_argument naming file and line: not readable, not TOML, a table or a date where a value should
/// be
std::vector<ConfigEntry> read_config(const std::filesystem::path& file);

}  // namespace metastable::reports
