#include "reports/command_line/manual.h"

#include <gtest/gtest.h>
#include <stdio.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "tests/own_folder.h"
#include "tests/reports/support.h"

namespace metastable::reports {
namespace {

const std::vector<ManualCommand> manual{
    {"steps",
     "Expected steps",
     {{"--law", "published|coulomb", "published", "Contact law", false},
      {"--slope", "DEG", "7.02", "Ramp's slope [deg]: any", false},
      {"--json", "FILE|-", "", "Write JSON", false},
      {"--separator", "','|';'|tab", ",", "Between fields", false},
      {"--direct", "", "", "-follow every landing", false}},
     "",
     {"metastable steps --slope 9 \\\n    --direct"}},
    {"describe", "What the trials say", {{"DIR", "", "", "Folder", true}, {"--out", "DIR", "", "Folder", false}}},
    {"blind", "The check", {{"ACTION", "make|open", "", "What to do", true}, {"DIR", "", "", "Folder", true}}},
    {"man", "The manual", {{"COMMAND", "", "", "One of them", true}}}};

// Returns what bash itself makes of the script, for the words of a command line of which the last is to be completed.
// Runs a script in a shell and returns the first line it prints.
std::string first_line(const std::string& shell, const std::string& text) {
  const std::filesystem::path script = metastable::test::own_folder();
  std::ofstream(script) << text;
  std::array<char, 400> line{};
  {
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen((shell + " " + script.string()).c_str(), "r"), ::pclose);
    if (std::fgets(line.data(), line.size(), pipe.get()) == nullptr) line[0] = 0;
  }
  std::filesystem::remove(script);
  return line.data();
}

std::string completed(const std::string& words, int last) {
  return first_line("bash", completion_script(manual, "bash") + "COMP_WORDS=(" + words +
                                ")\nCOMP_CWORD=" + std::to_string(last) + "\n_metastable\necho \"${COMPREPLY[*]}\"\n");
}

// Sourced, or found on the path, where zsh is there.
TEST(Manual, ZshLearnsWhoseCompletionItIs) {
  if (first_line("zsh -f 2>/dev/null", "echo there") != "there\n") GTEST_SKIP() << "zsh is not there";
  const std::string begin = "autoload -U compinit; compinit -u -D\n", script = completion_script(manual, "zsh");
  EXPECT_EQ(first_line("zsh -f", begin + script + "echo ${_comps[metastable]}\n"), "_metastable\n");
  // On the path the script is the function's body.
  EXPECT_EQ(first_line("zsh -f",
                       "_describe() { echo described }; CURRENT=2\n_metastable() {\n" + script + "}\n_metastable\n"),
            "described\n");
}

TEST(Manual, BashCompletesCommandsOptionsAndValues) {
  EXPECT_EQ(completed("metastable ''", 1), "steps describe blind man --help --version\n");
  EXPECT_EQ(completed("metastable st", 1), "steps\n");
  EXPECT_EQ(completed("metastable steps --s", 2), "--slope --separator\n");
  EXPECT_EQ(completed("metastable steps --separator ''", 3), ", ; tab\n");  // said with quotes
  EXPECT_EQ(completed("metastable blind ''", 2), "make open\n");
  EXPECT_EQ(completed("metastable blind make /bi", 3), "/bin\n");
  EXPECT_EQ(completed("metastable man st", 2), "steps\n");
  EXPECT_EQ(completed("metastable steps --law ''", 3), "published coulomb\n");
  EXPECT_EQ(completed("metastable steps --law c", 3), "coulomb\n");
  EXPECT_EQ(completed("metastable steps --slope ''", 3), "\n");
  EXPECT_EQ(completed("metastable steps --json /bi", 3), "/bin\n");
  EXPECT_EQ(completed("metastable describe /bi", 2), "/bin\n");
}

TEST(Manual, OtherShellsAndPagesEscapeWhatTheyWouldTakeForSyntax) {
  const std::string zsh = completion_script(manual, "zsh"), fish = completion_script(manual, "fish");
  EXPECT_NE(zsh.find(R"('*--slope=[Ramp'\''s slope (deg)\: any]:DEG: ')"), std::string::npos) << zsh;
  EXPECT_NE(zsh.find("'*--law=[Contact law]:published|coulomb:(published coulomb)'"), std::string::npos) << zsh;
  EXPECT_NE(fish.find(R"(-l slope -x -d 'Ramp'\''s slope [deg]: any')"), std::string::npos) << fish;
  EXPECT_NE(fish.find("from describe' -l out -r -F"), std::string::npos) << fish;
  EXPECT_NE(fish.find(R"(-l separator -x -a ''\'','\'' '\'';'\'' tab')"), std::string::npos) << fish;
  EXPECT_NE(fish.find("from blind' -a 'make open'"), std::string::npos) << fish;
  EXPECT_NE(zsh.find("'1:ACTION:(make open)'"), std::string::npos) << zsh;
  EXPECT_NE(zsh.find("'1:COMMAND:(steps describe blind man)'"), std::string::npos) << zsh;
  const std::string page = manual_page(manual, "steps", "1.0");
  EXPECT_NE(page.find("\\fB\\-\\-slope\\fR \\fIDEG\\fR\nRamp's slope [deg]: any (default: 7.02).\n"), std::string::npos)
      << page;
  EXPECT_NE(page.find("\n\\-follow every landing.\n"), std::string::npos) << page;
  EXPECT_NE(
      page.find(
          "\n.SH EXAMPLES\n.nf\nmetastable steps \\-\\-slope 9 \\e\n    \\-\\-direct\n.fi\n.SH OPTIONS\n.SS Options\n"),
      std::string::npos)
      << page;
  EXPECT_NE(manual_page(manual, "", "1.0").find("\\fBmetastable\\-describe\\fR(1)\nWhat the trials say.\n"),
            std::string::npos);
}

TEST(Manual, RefusesOtherShellsAndCommands) {
  EXPECT_THROW(completion_script(manual, "tcsh"), std::invalid_argument);
  EXPECT_THROW(manual_page(manual, "walk", "1.0"), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::reports
