#include "reports/study_command.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "analysis/input_error.h"

namespace metastable::reports {
namespace {
namespace fs = std::filesystem;

std::string read(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(StudyCommand, WritesThePageAndEveryTableTheSameTwice) {
  const fs::path folder = fs::temp_directory_path() / ("metastable_study_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  for (const char* name : {"one", "two"}) {
    StudyRequest request;
    request.out = (folder / name).string();
    request.options.trials = 20;
    request.options.samples = 32;
    request.options.threads = name[0] == 'o' ? 1 : 2;
    testing::internal::CaptureStdout();
    run_study(request);
    testing::internal::GetCapturedStdout();
  }
  for (const char* file :
       {"index.html", "tables/claims.csv", "tables/changes.csv", "tables/readings.md", "tables/hypotheses.tex",
        "tables/variance.csv", "tables/fig4.csv", "tables/fig6.csv", "tables/equal-legs.csv", "tables/fig7.csv",
        "tables/fig8.csv", "tables/fig9.csv", "figures/fig4-experiment.svg", "figures/fig6-published-rests-0-55.svg",
        "figures/fig9-coulomb-0-2.svg"}) {
    EXPECT_FALSE(read(folder / "one" / file).empty()) << file;
    EXPECT_EQ(read(folder / "one" / file), read(folder / "two" / file)) << file;
  }
  // A simulation is never shown as a measurement.
  for (const char* file : {"tables/claims.csv", "tables/changes.csv", "tables/fig4.csv", "tables/fig7.csv"})
    EXPECT_NE(read(folder / "one" / file).find("measurements are not public"), std::string::npos) << file;
  StudyRequest bad;
  bad.data = (folder / "nothing").string();
  bad.out = (folder / "three").string();
  EXPECT_THROW(run_study(bad), analysis::InputError);
  EXPECT_FALSE(fs::exists(folder / "three"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace metastable::reports
