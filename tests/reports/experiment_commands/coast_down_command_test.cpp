// What `metastable coast-down` makes of a log.

#include "reports/experiment_commands/coast_down_command.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using CoastDownCommand = CommandLine;

TEST_F(CoastDownCommand, TakesTheNominalLossOfAnotherFolder) {
  std::string log;
  double time = 0, square = 900;
  for (int k = 0; k < 700; ++k) {
    log += std::to_string(static_cast<long>(time * 1e6)) + ",1," + std::to_string(k) + ",1," + std::to_string(k) + "\n";
    time += 6.283185307 / std::sqrt(square);
    square -= 0.2 + 0.002 * square;
  }
  const std::string free = file("free.csv", log);
  EXPECT_EQ(metastable({"coast-down", free, "--out", path("a")}).code, 0);
  EXPECT_EQ(metastable({"coast-down", free, "--nominal", path("a"), "--out", path("b")}).code, 0);
  const std::string a = read(folder_ / "a" / "experiment.toml"), b = read(folder_ / "b" / "experiment.toml");
  EXPECT_EQ(a.substr(a.find("[loss]")), b.substr(b.find("[loss]")));
  EXPECT_EQ(metastable({"coast-down", free, free, "--out", path("c")}).err,
            "metastable: " + free + ": a log named so was there before\n");
  EXPECT_EQ(metastable({"coast-down", path("none.csv"), "--out", path("c")}).err,
            "metastable: " + path("none.csv") + ": cannot be read: No such file or directory\n");
  EXPECT_FALSE(std::filesystem::exists(path("c")));
}

}  // namespace
}  // namespace metastable::reports::test
