#include "reports/experiment_commands/describe_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "analysis/experiment/input_error.h"
#include "analysis/experiment/stand_in.h"
#include "reports/experiment_commands/simulate_command.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {
namespace fs = std::filesystem;

class DescribeCommandTest : public InFolder {
 protected:
  void SetUp() override {
    InFolder::SetUp();
    SimulateRequest request;
    request.setting = analysis::stand_in_setting();
    request.trials = 12;
    request.out = path("in");
    printed([&] { run_simulate(request); });
  }

  std::string run(const std::string& out) const {
    DescribeRequest request;
    request.folder = path("in");
    request.out = out;
    request.against = {dynamics::Law::plastic};
    request.trials = 100;
    return printed([&] { run_describe(request); });
  }
};

TEST_F(DescribeCommandTest, TablesOnTheTerminal) {
  const std::string said = run("");
  for (const char* text :
       {"The conditions\n", "\nRestitution and friction by maximum likelihood under published\n", "plastic"})
    EXPECT_NE(said.find(text), std::string::npos) << text << said;
  EXPECT_EQ(said.find("seed:"), std::string::npos);
}

TEST_F(DescribeCommandTest, AFolderWithEverythingTheSameTwice) {
  const fs::path one = folder_ / "one", two = folder_ / "two";
  run(one.string());
  run(two.string());
  for (const char* file : {"index.html", "tables/conditions.csv", "tables/profiles.tex", "tables/survival.md",
                           "tables/contact.csv", "tables/laws.csv", "figures/profiles.svg", "figures/survival.svg",
                           "figures/legs.svg", "figures/return-map-7-02.svg"}) {
    EXPECT_FALSE(read(one / file).empty()) << file;
    EXPECT_EQ(read(one / file), read(two / file)) << file;
  }
}

// A figure without a point could not be drawn, and half of the folder was left.
TEST_F(DescribeCommandTest, TrialsOfOneCollision) {
  SimulateRequest request;
  request.setting = analysis::stand_in_setting();
  request.trials = 3;
  request.collisions = 1;
  fs::remove_all(folder_ / "in");
  request.out = path("in");
  printed([&] { run_simulate(request); });
  DescribeRequest described;
  described.folder = path("in");
  described.out = path("out");
  printed([&] { run_describe(described); });
  EXPECT_TRUE(fs::exists(folder_ / "out/index.html"));
  EXPECT_TRUE(fs::exists(folder_ / "out/tables/conditions.csv"));
}

TEST_F(DescribeCommandTest, BadFolder) {
  fs::remove(folder_ / "in/collisions.csv");
  EXPECT_THROW(run(""), analysis::InputError);
}

}  // namespace
}  // namespace metastable::reports::test
