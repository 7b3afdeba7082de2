// Runs the program as its users meet it: arguments in, exit code, streams and files out.

#include "reports/command_line/cli.h"

#include <gtest/gtest.h>

#include <csignal>
#include <regex>
#include <string>

#include "reports/output/interrupt.h"
#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {

TEST_F(CommandLine, HelpAndVersion) {
  EXPECT_EQ(metastable({"--help"}).code, 0);
  const Ran version = metastable({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_TRUE(std::regex_match(
      version.out,
      std::regex("metastable 0\\.2\\.0(\\+g[0-9a-f]+(-dirty)?)?\nbuilt by \\w+ \\d+[.\\d]* .*\nwith .*\n")))
      << version.out;
  for (const char* library : {"Boost 1.", "CLI11 ", "Eigen 3.", "KLU 1.", "OpenSSL ", "Spectra 1.", "fmt ", "toml++ "})
    EXPECT_NE(version.out.find(library), std::string::npos) << library;
  for (const char* command : {"steps", "compare", "sweep", "simulate", "report"}) {
    const Ran help = metastable({command, "--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("--config"), std::string::npos) << command;
  }
}

TEST_F(CommandLine, ConfigFileAndOptionsGiveTheSameBytesAndOptionsWin) {
  const std::string config = file("c.toml",
                                  "slope = 9.59\nlegs = 0.1519\nfriction = [0.3, 0.1]\ncells = 32\nsamples = 256\n"
                                  "initial-speed = [5.83, 0.28]\n");
  const Ran by_file = metastable({"steps", "--config", config});
  const Ran by_options = metastable(with({"steps", "--slope", "9.59", "--friction", "0.3,0.1"}, quick));
  ASSERT_EQ(by_file.code, 0) << by_file.err;
  EXPECT_EQ(by_file.out, by_options.out);
  const Ran overridden = metastable({"steps", "--config", config, "--friction", "0.4,0.1"});
  EXPECT_NE(overridden.out, by_file.out);
  EXPECT_NE(overridden.out.find("mu ~ N(0.4, 0.1^2)"), std::string::npos);
}

TEST_F(CommandLine, InterruptLeavesNoFileAndItsOwnExitCode) {
  catch_interrupts();
  std::raise(SIGINT);  // as if Ctrl-C came before the first result
  const Ran ran = metastable(with({"steps", "--json", path("x.json")}, quick));
  clear_interrupt();
  EXPECT_EQ(ran.code, 130);
  EXPECT_TRUE(left_behind().empty());
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(CommandLine, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{}, "subcommand"},
      {{"--foo"}, "--foo: is no option before a subcommand; --help and --version are"},
      {{"stepz"}, "stepz"},
      {{"steps", "--seed", "1", "--seed", "2"}, "--seed: given 2 times"},
      {{"steps", "--config", path("")}, ": cannot be read: it is a folder"},
      {{"describe"}, "DIR is required; see 'metastable describe --help'"},
      {{"report", "--out", file("report.csv", "")}, "report.csv"},
      {{"verify", "--out", file("verify.csv", "")}, "verify.csv: Not a directory"},
      {{"verify", "--export", file("chain.csv", "")}, "chain.csv: Not a directory"},
      {{"study", "--out", file("study.csv", "")}, "study.csv"},
      {{"study", "--data", path("none"), "--out", path("study")}, "none: there is no such folder"},
      {{"coast-down", path(""), "--out", path("drum")}, ": cannot be read"},
      {{"lessons", "--data", path("none"), "--out", path("lessons")}, "none: there is no such folder"},
  });
}

}  // namespace
}  // namespace metastable::reports::test
