#include "reports/command_line/help.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>

#include "reports/command_line/options.h"
#include "tests/reports/program.h"

namespace metastable::reports {
namespace {

// Returns the longest line of a text, without its examples, which stand as they are.
std::string longest_line(const std::string& text) {
  std::istringstream lines(text);
  std::string longest;
  bool example = false;
  for (std::string line; std::getline(lines, line);) {
    example = line == "Examples" || (example && !line.empty());
    if (!example && line.size() > longest.size()) longest = line;
  }
  return longest;
}

TEST(Help, PutsExamplesFirstAndOptionsInGroups) {
  ManualCommand command{"walk", "Walks", {}, "Of walking.", {"metastable walk --slope 1 \\\n    --out x"}};
  command.options.push_back({"PLACE", "here|there", "", "Where", true, "Options"});
  for (const std::string_view group : option_groups)
    command.options.push_back(
        {"--" + std::to_string(command.options.size()), "N", "2", "A number", false, std::string(group)});
  std::ranges::reverse(command.options);
  std::string help = command_help(command, "metastable", 80);
  EXPECT_TRUE(
      help.starts_with("Walks\n\nUsage: metastable walk PLACE [OPTIONS]\n\nExamples\n"
                       "  metastable walk --slope 1 \\\n    --out x\n\nWhat it takes\n"
                       "  PLACE                   Where: here, there\n\nOptions\n"
                       "  --1 N                   A number (default: 2)\n"))
      << help;
  std::size_t at = 0;
  for (const std::string_view group : option_groups) {
    const std::size_t next = help.find("\n" + std::string(group) + "\n", at);
    ASSERT_NE(next, std::string::npos) << group << "\n" << help;
    at = next;
  }
  EXPECT_TRUE(help.ends_with("\nOf walking.\n")) << help;

  command.options.resize(8);  // so few need no groups
  help = command_help(command, "metastable", 80);
  EXPECT_EQ(help.find("\nWheel\n"), std::string::npos) << help;
}

// Whoever reads help in a pipe has 80 columns, and finds each option of each command.
TEST(Help, OfEveryCommandFitsTheColumnsAndHoldsEveryOption) {
  const std::string commands = test::metastable({"--help"}).out;
  EXPECT_LE(longest_line(commands).size(), 80u) << longest_line(commands);
  for (const char* command :
       {"steps", "compare", "sweep", "solve", "simulate", "import", "coast-down", "collisions", "describe", "study",
        "diagnose", "lessons", "effects", "report", "verify", "blind", "man", "completion", "doctor"}) {
    EXPECT_NE(commands.find("\n  " + std::string(command) + " "), std::string::npos) << command;
    const std::string help = test::metastable({command, "--help"}).out;
    EXPECT_LE(longest_line(help).size(), 80u) << command << ": " << longest_line(help);
    for (const char* option : {"\n  -h, --help", "\n  --json FILE|-", "\n  --config FILE"})
      EXPECT_NE(help.find(option), std::string::npos) << command << "\n" << help;
  }
  const std::string steps = test::metastable({"steps", "--help"}).out;
  EXPECT_LT(steps.find("\nExamples\n  metastable steps "), steps.find("\nQuestion\n")) << steps;
  EXPECT_NE(steps.find("\nWheel\n  --legs "), std::string::npos) << steps;
  EXPECT_NE(steps.find("\nWalkers on two legs (--walker)\n  --walker "), std::string::npos) << steps;
}

TEST(Help, BreaksLinesWhereTheTerminalEnds) {
  const ManualCommand command{
      "walk", "Walks", {{"--slope", "DEG", "7", "The slope of the ramp in degrees, and more words on it", false}}};
  for (const std::size_t width : {50u, 60u, 100u}) {
    const std::string help = command_help(command, "metastable", width);
    EXPECT_LE(longest_line(help).size(), width) << help;
  }
}

}  // namespace
}  // namespace metastable::reports
