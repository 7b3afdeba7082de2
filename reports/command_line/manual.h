#pragma once
// Writes what the option tables say as scripts of shells and as manual pages.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace metastable::reports {

/// Holds one option as a table of options has it.
struct ManualOption {
  std::string name;      ///< "--slope"; "DIR" of what is given by its place
  std::string value;     ///< "DEG"; "" of a flag
  std::string fallback;  ///< "" where there is none
  std::string help;
  bool place = false;             ///< given by its place on the command line
  std::string group = "Options";  ///< one of option_groups
};

struct ManualCommand {
  std::string name, summary;
  std::vector<ManualOption> options;
  std::string details = {};
  std::vector<std::string> examples = {};
};

/// Returns the options under the names of their groups, places first. Where there are few, all others are one group.
std::vector<std::pair<std::string, std::vector<ManualOption>>> option_groups_of(const ManualCommand& command);

inline constexpr std::string_view shells[] = {"bash", "zsh", "fish"};

/// Returns the script that completes commands, options, values such as published|coulomb, and files.
/// @param shell  one of shells @throws std::invalid_argument naming them
std::string completion_script(const std::vector<ManualCommand>& commands, std::string_view shell);

/// Returns a manual page in troff: metastable(1), or metastable-NAME(1) of one command.
/// @param command  a name, or "" @throws std::invalid_argument for a name that is none
std::string manual_page(const std::vector<ManualCommand>& commands, std::string_view command, std::string_view version);

}  // namespace metastable::reports
