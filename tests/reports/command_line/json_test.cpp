// With --json - of every command standard output holds one JSON and nothing else.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {
using Json = nlohmann::json;

class JsonOfEveryCommand : public InFolder {
 protected:
  // Returns what a command answers; null where it is no JSON alone.
  Json answer(std::vector<std::string> words) const {
    words.insert(words.end(), {"--json", "-"});
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 0) << ran.err;
    return Json::parse(ran.out, nullptr, false);
  }
};

TEST_F(JsonOfEveryCommand, IsOffered) {
  std::map<std::string, bool> offers;
  const Json told = answer({"man"});
  for (const Json& row : told["tables"]["options"]["rows"]) {
    bool& offered = offers[row[0]];
    offered = offered || row[1] == "--json";
  }
  for (const auto& [command, offered] : offers) EXPECT_TRUE(offered) << command;
  EXPECT_GE(offers.size(), 18u);
}

TEST_F(JsonOfEveryCommand, IsAllOfStandardOutput) {
  const std::vector<std::string> quick{"--cells", "16", "--samples", "64", "--replicates", "2", "--threads", "1"};
  std::vector<std::vector<std::string>> all{
      {"doctor"},
      {"effects"},
      {"man", "steps"},
      {"completion", "bash"},
      {"steps"},
      {"compare"},
      {"solve", "friction-mean", "--steps", "5", "--points", "3"},
      {"sweep", "--friction-mean", "0.3,0.4", "--out", path("sweep.csv")},
      {"simulate", "--trials", "3", "--angle-rate", "120", "--out", path("plain")},
      {"simulate", "--reality", "--trials", "3", "--out", path("reality")},
      {"simulate", "--walker", "simplest", "--slope-sd", "0.1", "--trials", "2", "--out", path("walks")},
      {"collisions", path("plain")},
      {"describe", path("plain")},
      {"import", path("plain/collisions.csv"), "--description", path("plain/experiment.toml"), "--out", path("import")},
      {"blind", "make", path("run"), "--seed", "1", "--per-effect", "0", "--none", "1", "--pairs", "0", "--outside",
       "0", "--left-out", "0"}};
  for (std::vector<std::string>& words : all) {
    if (words[0] == "steps" || words[0] == "compare" || words[0] == "sweep" || words[0] == "solve")
      words.insert(words.end(), quick.begin(), quick.end());
    SCOPED_TRACE(fmt::format("{}", fmt::join(words, " ")));
    const Json told = answer(words);
    EXPECT_TRUE(told.is_object() && (told.contains("provenance") || told.contains("effects"))) << told;
  }
}

TEST_F(JsonOfEveryCommand, IsAFileBesideWhatIsPrintedOrRefused) {
  const Ran plain = metastable({"doctor"}), both = metastable({"doctor", "--json", path("doctor.json")});
  EXPECT_EQ(both.out, plain.out);
  EXPECT_TRUE(Json::parse(read(path("doctor.json")))["facts"].contains("version"));
  const Ran full = metastable({"doctor", "--json", "/dev/full"}), none = metastable({"doctor", "--json", ""});
  EXPECT_EQ(full.code, 2);
  EXPECT_EQ(full.err, "metastable: cannot write /dev/full: No space left on device\n");
  EXPECT_EQ(none.code, 2);
  EXPECT_EQ(none.err, "metastable: --json: what is given is empty\n");
}

// What is printed without it is told with it, and the files that were written.
TEST_F(JsonOfEveryCommand, TellsWhatIsPrinted) {
  const std::vector<std::string> words{"sweep",
                                       "--law",
                                       "published",
                                       "--friction-mean",
                                       "0.3,0.4",
                                       "--cells",
                                       "16",
                                       "--samples",
                                       "64",
                                       "--replicates",
                                       "2",
                                       "--threads",
                                       "1",
                                       "--out",
                                       path("sweep.csv")};
  const Json told = answer(words);
  std::string said;
  for (const Json& line : told["said"]) said += line.get<std::string>() + "\n";
  EXPECT_EQ(said, path("sweep.csv") + ": 2 points (0 taken over); " + path("sweep.svg") + "\n");
  EXPECT_EQ(told["files"], Json({path("sweep.csv"), path("sweep.svg")}));
  EXPECT_EQ(told["tables"]["sweep"]["rows"].size(), 2u);
  EXPECT_EQ(told["tables"]["sweep"]["rows"][1][0], 0.4);
  const Ran plain = metastable(words);
  EXPECT_EQ(plain.out, path("sweep.csv") + ": 2 points (2 taken over); " + path("sweep.svg") + "\n");
}

}  // namespace
}  // namespace metastable::reports::test
