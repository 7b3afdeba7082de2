// The page of `metastable report`.

#include "reports/commands/report_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <string>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using ReportCommand = CommandLine;

// The whole report, made on one thread and on two, has the same bytes in every file.
TEST_F(ReportCommand, IsTheSameBytesOnAnyNumberOfThreads) {
  const auto report = [&](const std::string& name, const std::string& threads) {
    return metastable(with({"report", "--out", path(name), "--threads", threads, "--slopes", "9.59", "--energy-trials",
                            "20", "--landings", "3000"},
                           quick));
  };
  const Ran one = report("one", "1"), two = report("two", "2");
  ASSERT_EQ(one.code, 0) << one.err;
  ASSERT_EQ(two.code, 0) << two.err;
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "one")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const auto relative = std::filesystem::relative(entry.path(), folder_ / "one");
    EXPECT_EQ(read(entry.path()), read(folder_ / "two" / relative)) << relative;
  }
  const std::string page = read(folder_ / "one" / "index.html");
  // The answer comes first, the long table last and folded; every figure and table names a law.
  EXPECT_LT(page.find("under the law of rigid bodies (settled)"), page.find("<section"));
  EXPECT_LT(page.find("figure-survival"), page.find("<details>"));
  EXPECT_LT(page.rfind("<details>", page.find("table-ramps")), page.find("table-ramps"));
  const std::regex told(R"(<title>([^<]*)</title>\n<desc>|<figcaption>([^<]*)</figcaption>)");
  std::size_t titles = 0;
  for (std::sregex_iterator match(page.begin(), page.end(), told), end; match != end; ++match, ++titles)
    EXPECT_TRUE(std::regex_search(match->str(), std::regex("settled|published|law"))) << match->str();
  EXPECT_GT(titles, 20u);
  const std::string csv = read(folder_ / "one" / "tables" / "ramps.csv");
  for (const char* part : {"# seed: 1", "# version: ", "# settings: ", "infinite"})
    EXPECT_NE(csv.find(part), std::string::npos) << part;
}

}  // namespace
}  // namespace metastable::reports::test
