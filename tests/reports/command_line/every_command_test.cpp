// Wrong input to every command: exit code 2, one line that says what and where, and nothing written.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {

class EveryCommand : public InFolder {
 protected:
  void SetUp() override {
    InFolder::SetUp();
    ASSERT_EQ(metastable({"simulate", "--trials", "3", "--angle-rate", "120", "--out", path("exp")}).code, 0);
    commands_ = {
        {"steps", {}},
        {"compare", {}},
        {"sweep", {"--friction-mean", "0.3,0.4", "--out", path("sweep.csv")}},
        {"solve", {"slope", "--steps", "100"}},
        {"simulate", {"--out", path("new")}},
        {"import", {path("exp/collisions.csv"), "--description", path("exp/experiment.toml"), "--out", path("new")}},
        {"coast-down", {file("drum.txt", "1 2\n"), "--out", path("new")}},
        {"collisions", {path("exp"), "--out", path("found.csv")}},
        {"describe", {path("exp"), "--out", path("new")}},
        {"study", {"--trials", "20", "--out", path("new/study")}},
        {"diagnose", {path("exp"), "--out", path("new")}},
        {"lessons", {"--data", path("exp"), "--out", path("new")}},
        {"effects", {}},
        {"report", {"--out", path("new/report")}},
        {"verify", {"--out", path("new"), "--export", path("exported")}},
        {"blind", {"make", path("run")}},
        {"man", {}},
        {"completion", {"bash"}},
        {"doctor", {}}};
    before_ = names();
  }

  std::set<std::string> names() const {
    std::set<std::string> all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_)) all.insert(entry.path().string());
    return all;
  }
  // The one line that a command is refused with.
  std::string refusal(const std::string& command, const std::vector<std::string>& more) {
    std::vector<std::string> words{command};
    words.insert(words.end(), commands_.at(command).begin(), commands_.at(command).end());
    words.insert(words.end(), more.begin(), more.end());
    SCOPED_TRACE(fmt::format("{}", fmt::join(words, " ")));
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 2);
    EXPECT_EQ(ran.out, "");
    EXPECT_EQ(std::ranges::count(ran.err, '\n'), 1) << ran.err;
    EXPECT_EQ(names(), before_);
    return ran.err.substr(0, ran.err.find('\n'));
  }

  std::map<std::string, std::vector<std::string>> commands_;  // with what they need
  std::set<std::string> before_;
};

TEST_F(EveryCommand, SuggestsTheOptionThatWasMeant) {
  for (const auto& [command, needs] : commands_)
    EXPECT_EQ(refusal(command, {"--jsn", "-"}),
              fmt::format("metastable: --jsn: is no option of '{}'; did you mean '--json'?", command));
}

TEST_F(EveryCommand, RefusesAConfigurationThatItCannotRead) {
  const std::string unknown = file("unknown.toml", "\nhorsepower = 3\n"), broken = file("broken.toml", "a = [1,\n");
  before_ = names();
  for (const auto& [command, needs] : commands_) {
    EXPECT_EQ(refusal(command, {"--config", path("none.toml")}),
              fmt::format("metastable: {}: cannot be read: No such file or directory", path("none.toml")));
    EXPECT_EQ(refusal(command, {"--config", unknown}),
              fmt::format("metastable: {}:2: unknown key 'horsepower' (keys are the long options of 'metastable {}')",
                          unknown, command));
    EXPECT_TRUE(refusal(command, {"--config", broken}).starts_with("metastable: " + broken + ":1: ")) << command;
  }
}

TEST_F(EveryCommand, WritesNothingWhereItsJsonCannotBe) {
  for (const auto& [command, needs] : commands_)
    EXPECT_EQ(refusal(command, {"--json", path("none/x.json")}),
              fmt::format("metastable: cannot write {}: No such file or directory", path("none/x.json")));
}

// An option's first command stands for the others, which read it alike.
TEST_F(EveryCommand, NamesTheOptionWhoseValueIsNone) {
  const auto told = nlohmann::json::parse(metastable({"man", "--json", "-"}).out);
  std::set<std::string> seen{"--title", "--tool"};  // any text will do
  for (const nlohmann::json& row : told["tables"]["options"]["rows"]) {
    const std::string command = row[0], option = row[1], value = row[2].is_null() ? "" : row[2];
    if (!option.starts_with("--") || value.empty() || value.starts_with("FILE") || value == "DIR") continue;
    if (!seen.insert(option).second) continue;
    const std::string said = refusal(command, {option, "x!"});
    EXPECT_TRUE(said.find(option) != std::string::npos || said.find("law: \"x!\"") != std::string::npos) << said;
  }
  EXPECT_GT(seen.size(), 60u);
}

TEST_F(EveryCommand, ThatReadsAFolderNamesFileLineAndColumn) {
  const std::string rows = read(path("exp/collisions.csv")),
                    cell = rows.substr(0, rows.find('\n') + 1) + "7.02,1,1,x\n";
  file("exp/collisions.csv", cell);
  const std::string said = fmt::format("metastable: {}:2", path("exp/collisions.csv"));
  for (const char* command : {"describe", "diagnose", "lessons", "import"})
    EXPECT_TRUE(refusal(command, {}).starts_with(said)) << command;
  EXPECT_TRUE(refusal("study", {"--data", path("exp")}).starts_with(said));
  file("exp/angle.csv", "trial,time_s,angle_rad\n1,0,east\n");
  std::filesystem::remove(path("exp/collisions.csv")), std::filesystem::remove(path("exp/trials.csv"));
  before_ = names();
  EXPECT_TRUE(refusal("collisions", {}).starts_with(fmt::format("metastable: {}:2", path("exp/angle.csv"))));
  for (const char* command : {"collisions", "describe", "diagnose"}) {
    commands_[command] = {path("nowhere")};
    EXPECT_EQ(refusal(command, {}), fmt::format("metastable: {}: there is no such folder", path("nowhere")));
  }
}

// What is written is no other file of the command, under whatever name.
TEST_F(EveryCommand, WritesItsJsonIntoAFileOfItsOwn) {
  const std::string config = file("config.toml", "seed = 2\n"),
                    pairs = file("pairs.csv", "restitution,friction\n.4,.4\n");
  std::filesystem::create_symlink(path("exp"), path("link"));
  before_ = names();
  const auto expect = [&](const std::string& command, const std::string& json, const std::string& said,
                          std::vector<std::string> more = {}) {
    more.insert(more.end(), {"--json", path(json)});
    EXPECT_EQ(refusal(command, more), fmt::format("metastable: --json: {} {}", path(json), said));
  };
  const auto in_folder = [](const std::string& option) {
    return "lies in the folder of " + option +
           ", where its name must end in .json: it could replace another file there";
  };
  expect("steps", "config.toml", "is what --config reads too", {"--config", config});
  expect("steps", "pairs.csv", "is what --contact-list reads too", {"--contact-list", pairs});
  expect("sweep", "sweep.csv", "is what --out writes too");
  expect("sweep", "exp/../sweep.csv", "is what --out writes too");
  expect("sweep", "sweep.svg", "is what --out " + path("sweep.csv") + " writes too");
  expect("sweep", "sweep.csv.partial", "is what --out " + path("sweep.csv") + " writes too");
  expect("collisions", "found.csv", "is what --out writes too");
  expect("collisions", "exp/angle.csv", in_folder("DIR"));
  expect("describe", "link/collisions.csv", in_folder("DIR"));
  expect("import", "exp/collisions.csv", "is what FILE reads too");
  expect("import", "exp/experiment.toml", "is what --description reads too");
  expect("coast-down", "drum.txt", "is what LOG reads too");
  expect("lessons", "exp/trials.csv", in_folder("--data"));
  for (const char* command : {"describe", "diagnose", "lessons", "verify"})
    expect(command, "new/index.html", in_folder("--out"));
  for (const char* command : {"simulate", "diagnose", "verify"}) expect(command, "new", "is what --out writes too");
  expect("study", "new/study/tables/claims.csv", in_folder("--out"));
  expect("report", "new/report/index.html", in_folder("--out"));
  expect("verify", "exported/chain.mtx", in_folder("--export"));
  expect("blind", "run-sealed/0001.json", "lies in " + path("run-sealed") + ", which the blind check alone writes");
  expect("blind", "run/answers/0001.json", "lies in " + path("run/answers") + ", which the blind check alone writes");
  commands_["collisions"] = {path("exp")};
  EXPECT_EQ(refusal("collisions", {"--out", path("exp/angle.csv")}),
            fmt::format("metastable: --out: {} is what is read", path("exp/angle.csv")));
  EXPECT_EQ(refusal("sweep", {"--contact-list", path("sweep.csv")}),
            fmt::format("metastable: --out: {} is what --contact-list reads too", path("sweep.csv")));
}

// Beside the files of a folder it may stand, also of one that is not there yet.
TEST_F(EveryCommand, WritesItsJsonIntoTheFolderOfTheOthers) {
  const Ran ran = metastable({"describe", path("exp"), "--out", path("new"), "--json", path("new/new.json")});
  EXPECT_EQ(ran.code, 0) << ran.err;
  const auto told = nlohmann::json::parse(read(path("new/new.json")));
  for (const std::string name : told["files"]) EXPECT_TRUE(std::filesystem::exists(name)) << name;
  EXPECT_EQ(told["files"].size() + 1, [&] {  // and new.json
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path("new")))
      files += entry.is_regular_file();
    return files;
  }());
}

}  // namespace
}  // namespace metastable::reports::test
