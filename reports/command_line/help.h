#pragma once
// Writes what --help prints, from the tables that manual pages are made of.

#include <cstddef>
#include <string>
#include <vector>

#include "reports/command_line/manual.h"

namespace metastable::reports {

/// Counts the characters of a line of help: the terminal's width, at most 100; 80 where there is no terminal.
std::size_t help_width();

/// Returns the help of a command: its summary, usage and examples, its options in groups, its details. Examples stand
/// as they are, to be pasted; all else is broken at spaces. @param program  its name
std::string command_help(const ManualCommand& command, const std::string& program, std::size_t width);

/// Returns the help of the program: its commands.
std::string program_help(const std::vector<ManualCommand>& commands, const std::string& program,
                         const std::string& summary, std::size_t width);

/// Returns a command's details in lines of at most `width` characters: a paragraph, or lines that keep their indent.
std::string details_lines(const std::string& details, std::size_t width);

}  // namespace metastable::reports
