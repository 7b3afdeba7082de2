#include "reports/command_line/manual.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <ranges>
#include <sstream>
#include <stdexcept>

#include "analysis/experiment/suggestion.h"
#include "reports/command_line/help.h"
#include "reports/command_line/options.h"

namespace metastable::reports {
namespace {

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

// Returns the words an option or a place takes, with a space between them, if its value lists words (capitals stand for
// something else); the place COMMAND takes the commands.
std::string choices(const ManualOption& o, const std::vector<ManualCommand>& commands) {
  if (o.place && o.name == "COMMAND")
    return fmt::format("{}", fmt::join(commands | std::views::transform(&ManualCommand::name), " "));
  const bool words = std::ranges::none_of(o.value, [](char c) { return c >= 'A' && c <= 'Z'; });
  return words && o.value.find('|') != std::string::npos ? replaced(o.value, "|", " ") : "";
}

bool is_file(const ManualOption& o) {
  const std::string& what = o.place ? o.name : o.value;
  return what.starts_with("FILE") || what.starts_with("DIR") || what == "LOG";
}

std::string quoted(const std::string& text) { return "'" + replaced(text, "'", "'\\''") + "'"; }

auto names_of(const ManualCommand& command) {
  return command.options | std::views::filter([](const ManualOption& o) { return !o.place; }) |
         std::views::transform(&ManualOption::name);
}

std::string bash(const std::vector<ManualCommand>& commands) {
  std::string text =
      "# bash completion for metastable; made by: metastable completion bash\n"
      "_metastable() {\n"
      "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} options='' values=''\n"
      "  if ((COMP_CWORD == 1)); then\n";
  fmt::format_to(std::back_inserter(text), "    COMPREPLY=($(compgen -W '{} --help --version' -- \"$word\"))\n",
                 fmt::join(commands | std::views::transform(&ManualCommand::name), " "));
  text += "    return\n  fi\n  case ${COMP_WORDS[1]} in\n";
  for (const ManualCommand& command : commands) {
    fmt::format_to(std::back_inserter(text), "    {})\n      options='{}'\n", command.name,
                   fmt::join(names_of(command), " "));
    for (const ManualOption& o : command.options)
      if (const std::string words = choices(o, commands); o.place && !words.empty())
        text += "      [[ $COMP_CWORD == 2 && $word != -* ]] && values=" + quoted(words) + "\n";
    text += "      case $before in\n";
    for (const ManualOption& o : command.options) {
      const std::string words = choices(o, commands);
      if (!o.place && !o.value.empty())
        fmt::format_to(std::back_inserter(text), "        {}) values={} ;;\n", o.name,
                       is_file(o)      ? "/"
                       : words.empty() ? "-"
                                       : quoted(words));
    }
    text += "      esac ;;\n";
  }
  text +=
      "  esac\n"
      "  case $values in\n"
      "    -) COMPREPLY=() ;;\n"
      "    /) COMPREPLY=($(compgen -f -- \"$word\")) ;;\n"
      "    ?*) COMPREPLY=($(compgen -W \"$values\" -- \"$word\")) ;;\n"
      "    *)\n"
      "      if [[ $word == -* ]]; then\n"
      "        COMPREPLY=($(compgen -W \"$options\" -- \"$word\"))\n"
      "      else\n"
      "        COMPREPLY=($(compgen -f -- \"$word\"))\n"
      "      fi ;;\n"
      "  esac\n"
      "}\n"
      "complete -o filenames -F _metastable metastable\n";
  return text;
}

std::string zsh(const std::vector<ManualCommand>& commands) {
  const auto escaped = [](const std::string& text) {
    return replaced(replaced(replaced(text, "[", "("), "]", ")"), ":", "\\:");
  };
  std::string text =
      "#compdef metastable\n# made by: metastable completion zsh\n_metastable() {\n  local -a commands\n  commands=(\n";
  for (const ManualCommand& command : commands)
    fmt::format_to(std::back_inserter(text), "    {}\n", quoted(command.name + ":" + escaped(command.summary)));
  text +=
      "  )\n  if ((CURRENT == 2)); then\n    _describe command commands\n    return\n  fi\n"
      "  local command=$words[2]\n  shift words\n  ((CURRENT--))\n  case $command in\n";
  for (const ManualCommand& command : commands) {
    fmt::format_to(std::back_inserter(text), "    {})\n      _arguments", command.name);
    for (const ManualOption& o : command.options) {
      const std::string words = choices(o, commands);
      const std::string takes = is_file(o) ? "_files" : words.empty() ? " " : "(" + words + ")";
      const std::string what = o.place ? (words.empty() ? "*:" : "1:") + escaped(o.name) + ":" + takes
                               : o.value.empty()
                                   ? fmt::format("{}[{}]", o.name, escaped(o.help))
                                   : fmt::format("*{}=[{}]:{}:{}", o.name, escaped(o.help), escaped(o.value), takes);
      text += " \\\n        " + quoted(what);
    }
    text += " ;;\n";
  }
  // Where it lies on zsh's path it is this function's body, on its first call; where it is sourced it says whose it is.
  return text +
         "  esac\n}\nif [[ ${funcstack[1]} == _metastable ]]; then\n  _metastable \"$@\"\nelse\n"
         "  compdef _metastable metastable\nfi\n";
}

std::string fish(const std::vector<ManualCommand>& commands) {
  std::string text = "# made by: metastable completion fish\ncomplete -c metastable -f\n";
  for (const ManualCommand& command : commands)
    fmt::format_to(std::back_inserter(text), "complete -c metastable -n __fish_use_subcommand -a {} -d {}\n",
                   command.name, quoted(command.summary));
  for (const ManualCommand& command : commands)
    for (const ManualOption& o : command.options) {
      const std::string of = fmt::format("complete -c metastable -n '__fish_seen_subcommand_from {}'", command.name);
      const std::string words = choices(o, commands);
      if (o.place && !words.empty())
        text += fmt::format(
            "complete -c metastable -n 'test (count (commandline -opc)) -eq 2; and "
            "__fish_seen_subcommand_from {}' -a {} -d {}\n",
            command.name, quoted(words), quoted(o.help));
      if (o.place && is_file(o)) text += of + " -F\n";
      if (o.place) continue;
      const std::string takes = o.value.empty() ? ""
                                : is_file(o)    ? " -r -F"
                                : words.empty() ? " -x"
                                                : " -x -a " + quoted(words);
      text += fmt::format("{} -l {}{} -d {}\n", of, o.name.substr(2), takes, quoted(o.help));
    }
  return text;
}

// Escapes what troff would take for a command or an escape.
std::string troff(std::string text) {
  text = replaced(replaced(std::move(text), "\\", "\\e"), "-", "\\-");
  if (text.starts_with(".") || text.starts_with("'")) text = "\\&" + text;
  return text;
}

std::string head(const std::string& name, const std::string& summary, std::string_view version) {
  return fmt::format(".TH {} 1 \"\" \"metastable {}\" \"Metastability of walking machines\"\n.SH NAME\n{} \\- {}\n",
                     name, version, troff(name), troff(summary));
}

constexpr std::string_view exit_codes =
    ".SH EXIT STATUS\n0 done, 2 wrong option or file (one that cannot be written too), 3 a computation failed, 130 "
    "interrupted, 143 terminated.\n";

}  // namespace

std::vector<std::pair<std::string, std::vector<ManualOption>>> option_groups_of(const ManualCommand& command) {
  constexpr std::size_t few = 12;
  const bool together = std::ranges::count(command.options, false, &ManualOption::place) <= static_cast<long>(few);
  std::vector<std::pair<std::string, std::vector<ManualOption>>> groups{{"What it takes", {}}};
  for (const std::string_view group : option_groups) groups.emplace_back(group, std::vector<ManualOption>());
  for (const ManualOption& o : command.options) {
    const std::string group = o.place ? groups.front().first : together ? std::string(option_groups[0]) : o.group;
    std::ranges::find(groups, group, [](const auto& one) { return one.first; })->second.push_back(o);
  }
  std::erase_if(groups, [](const auto& group) { return group.second.empty(); });
  return groups;
}

std::string completion_script(const std::vector<ManualCommand>& commands, std::string_view shell) {
  if (shell == "bash") return bash(commands);
  if (shell == "zsh") return zsh(commands);
  if (shell == "fish") return fish(commands);
  throw std::invalid_argument(fmt::format("completion: '{}' is none of {}", shell, fmt::join(shells, ", ")));
}

std::string manual_page(const std::vector<ManualCommand>& commands, std::string_view command,
                        std::string_view version) {
  if (command.empty()) {
    std::string page =
        head("metastable", "expected steps before failure of walking machines, and diagnosis of trials", version) +
        ".SH SYNOPSIS\n.B metastable\n.I COMMAND\n[\\fIOPTIONS\\fR]\n.SH COMMANDS\n";
    for (const ManualCommand& one : commands)
      page += fmt::format(".TP\n\\fBmetastable\\-{}\\fR(1)\n{}.\n", troff(one.name), troff(one.summary));
    return page + std::string(exit_codes);
  }
  const auto found = std::ranges::find(commands, command, &ManualCommand::name);
  if (found == commands.end()) {
    std::vector<std::string> names;
    for (const ManualCommand& one : commands) names.push_back(one.name);
    throw std::invalid_argument(fmt::format("man: '{}' is none of the commands {}{}", command, fmt::join(names, ", "),
                                            analysis::did_you_mean(command, names)));
  }
  std::string page = head("metastable-" + found->name, found->summary, version) + ".SH SYNOPSIS\n.B metastable " +
                     troff(found->name) + "\n[\\fIOPTIONS\\fR]";
  for (const ManualOption& o : found->options)
    if (o.place) page += " \\fI" + troff(o.name) + "\\fR";
  page += "\n";
  const auto as_it_stands = [&page](const char* heading, const std::string& text) {
    page += fmt::format(".SH {}\n.nf\n", heading);
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) page += troff(line) + "\n";
    page += ".fi\n";
  };
  if (!found->examples.empty()) as_it_stands("EXAMPLES", fmt::format("{}", fmt::join(found->examples, "\n")));
  page += ".SH OPTIONS\n";
  for (const auto& [group, options] : option_groups_of(*found)) {
    page += fmt::format(".SS {}\n", troff(group));
    for (const ManualOption& o : options) {
      page += fmt::format(".TP\n\\fB{}\\fR", troff(o.name));
      if (!o.value.empty()) page += fmt::format(" \\fI{}\\fR", troff(o.value));
      page += "\n" + troff(o.help);
      if (!o.fallback.empty()) page += troff(fmt::format(" (default: {})", o.fallback));
      page += ".\n";
    }
  }
  if (!found->details.empty()) as_it_stands("DETAILS", details_lines(found->details, 72));
  return page + std::string(exit_codes) + ".SH SEE ALSO\n\\fBmetastable\\fR(1)\n";
}

}  // namespace metastable::reports
