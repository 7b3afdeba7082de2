#include "reports/experiment_commands/study_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "analysis/experiment/input_error.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {
namespace fs = std::filesystem;

using StudyCommandTest = InFolder;

TEST_F(StudyCommandTest, WritesThePageAndEveryTableTheSameTwice) {
  for (const char* name : {"one", "two"}) {
    StudyRequest request;
    request.out = path(name);
    request.options.trials = 20;
    request.options.samples = 32;
    request.options.threads = name[0] == 'o' ? 1 : 2;
    printed([&] { run_study(request); });
  }
  for (const char* file :
       {"index.html", "tables/claims.csv", "tables/changes.csv", "tables/readings.md", "tables/hypotheses.tex",
        "tables/variance.csv", "tables/fig4.csv", "tables/fig6.csv", "tables/equal-legs.csv", "tables/fig7.csv",
        "tables/fig8.csv", "tables/fig9.csv", "figures/fig4-experiment.svg", "figures/fig6-published-rests-0-55.svg",
        "figures/fig9-coulomb-0-2.svg", "figures/fig6-settled-0-55.svg", "figures/stopping-sticking.svg",
        "figures/stopping-resting.svg", "tables/stopping.csv"}) {
    EXPECT_FALSE(read(folder_ / "one" / file).empty()) << file;
    EXPECT_EQ(read(folder_ / "one" / file), read(folder_ / "two" / file)) << file;
  }
  // A simulation is never shown as a measurement.
  for (const char* file : {"tables/claims.csv", "tables/changes.csv", "tables/fig4.csv", "tables/fig7.csv"})
    EXPECT_NE(read(folder_ / "one" / file).find("measurements are not public"), std::string::npos) << file;
  StudyRequest bad;
  bad.data = path("nothing");
  bad.out = path("three");
  EXPECT_THROW(run_study(bad), analysis::InputError);
  EXPECT_FALSE(fs::exists(folder_ / "three"));
}

}  // namespace
}  // namespace metastable::reports::test
