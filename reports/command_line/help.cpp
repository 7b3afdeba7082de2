#include "reports/command_line/help.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <string_view>

#include "reports/output/text_table.h"

namespace metastable::reports {
namespace {

constexpr std::size_t piped_width = 80, widest = 100;
constexpr std::size_t column = 26;  // where the text beside an option begins

// Returns a label and beside it the text; below it, where the label is too long.
std::string entry(const std::string& label, const std::string& text, std::size_t begin, std::size_t width) {
  const std::string indent(begin, ' ');
  const std::string lines = wrapped(text, indent, width);
  if (label.size() + 2 > begin) return label + "\n" + lines;
  return label + lines.substr(label.size());
}

std::string option_entry(const ManualOption& o, std::size_t width) {
  std::string label = "  " + (o.name == "--help" ? "-h, " + o.name : o.name), text = o.help;
  if (o.place && !o.value.empty()) {
    std::string words = o.value;
    for (std::size_t at = 0; (at = words.find('|', at)) != std::string::npos;) words.replace(at, 1, ", ");
    text += ": " + words;
  } else if (!o.value.empty()) {
    label += " " + o.value;
  }
  if (!o.fallback.empty()) text += fmt::format(" (default: {})", o.fallback);
  return entry(label, text, column, width);
}

}  // namespace

std::string details_lines(const std::string& details, std::size_t width) {
  return details.find('\n') == std::string::npos ? wrapped(details, "", width) : fitted(details + "\n", width);
}

std::size_t help_width() { return ::isatty(STDOUT_FILENO) == 1 ? std::min(terminal_width(), widest) : piped_width; }

std::string command_help(const ManualCommand& command, const std::string& program, std::size_t width) {
  std::string usage = fmt::format("Usage: {} {}", program, command.name);
  for (const ManualOption& o : command.options)
    if (o.place) usage += " " + o.name;
  std::string text = wrapped(command.summary, "", width) + "\n" + usage + " [OPTIONS]\n";
  if (!command.examples.empty()) text += "\nExamples\n";
  for (const std::string& example : command.examples) text += "  " + example + "\n";
  for (const auto& [group, options] : option_groups_of(command)) {
    text += "\n" + group + "\n";
    for (const ManualOption& o : options) text += option_entry(o, width);
  }
  if (!command.details.empty()) text += "\n" + details_lines(command.details, width);
  return text;
}

std::string program_help(const std::vector<ManualCommand>& commands, const std::string& program,
                         const std::string& summary, std::size_t width) {
  std::string text = wrapped(summary, "", width) + fmt::format("\nUsage: {} COMMAND [OPTIONS]\n\nCommands\n", program);
  std::size_t longest = 0;
  for (const ManualCommand& command : commands) longest = std::max(longest, command.name.size());
  for (const ManualCommand& command : commands) text += entry("  " + command.name, command.summary, longest + 4, width);
  text += "\nOptions\n";
  text += entry("  -h, --help", "Prints this, and behind a command its options and examples", longest + 4, width);
  text += entry("  --version", "Prints the version and what it was built of", longest + 4, width);
  return text + "\n" +
         wrapped(
             "Exit codes: 0 done, 2 wrong option or file (one that cannot be written too), 3 a computation failed, "
             "130 interrupted, 143 terminated.",
             "", width);
}

}  // namespace metastable::reports
