#include "reports/experiment_commands/lessons_command.h"

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

class LessonsCommandTest : public InFolder {};

// With few trials and few candidates it has every section, with its tables and figures.
TEST_F(LessonsCommandTest, WritesEverySection) {
  SimulateRequest data;
  data.setting = analysis::stand_in_setting();
  data.trials = 12;
  data.out = path("data");
  printed([&] { run_simulate(data); });
  LessonsRequest request;
  request.data = {data.out};
  request.out = path("page");
  request.trials = 4;
  request.options.catalogue = {"slope_offset"};
  request.options.draws = 200;
  EXPECT_EQ(printed([&] { run_lessons(request); }), path("page/index.html") + "\n");
  const std::string page = read(folder_ / "page/index.html");
  for (const char* id :
       {"coulomb-wheel", "coulomb-wheel-said", "charge", "hypotheses", "data-1-answers", "data-1-published",
        "data-1-coulomb", "data-1-published-steps", "data-1-coulomb-steps", "data-1-balance"}) {
    EXPECT_NE(page.find("id=\"table-" + std::string(id) + "\""), std::string::npos) << id;
    EXPECT_TRUE(fs::exists(folder_ / "page/tables" / (std::string(id) + ".tex"))) << id;
  }
  const std::string charge = read(folder_ / "page/tables/charge.csv"),
                    believed = read(folder_ / "page/tables/hypotheses.csv");
  EXPECT_NE(charge.find("infinite"), std::string::npos) << charge;
  for (const char* row :
       {"\nnothing,", "\nlaunch speeds (H1),", "\ndifferences of the legs (H2),", "\nrestitution and friction (H3),"})
    EXPECT_NE(believed.find(row), std::string::npos) << row << believed;
}

TEST_F(LessonsCommandTest, WritesNothingWhereTheDataCannotBeRead) {
  LessonsRequest request;
  request.data = {path("none")};
  request.out = path("page");
  EXPECT_THROW(run_lessons(request), analysis::InputError);
  EXPECT_FALSE(fs::exists(folder_ / "page"));
}

}  // namespace
}  // namespace metastable::reports::test
