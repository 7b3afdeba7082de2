// Folders of machines that their user brings, and labels of any folder.

#include "analysis/walker_model/machine_folder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "analysis/experiment/input_error.h"
#include "analysis/walker_model/walk_folder.h"
#include "tests/analysis/machine_model/machines.h"
#include "tests/message_of.h"
#include "tests/own_folder.h"

namespace metastable::analysis::test {
namespace {

namespace fs = std::filesystem;

class MachineFolder : public ::testing::Test {
 protected:
  MachineFolder() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    machine_.inputs = {"load_kg"};
    put("experiment.toml", toml_);
    put("steps.csv",
        "trial,step,x,load_kg,crew,phase\n1,1,1.5,2,day,up\n1,2,1.4,2.5,day,down\n2,1,,3,night,up\n2,2,1.6,3,,down\n");
    put("trials.csv", "trial,outcome\n1,failed\n");
  }
  ~MachineFolder() override { fs::remove_all(folder_); }

  void put(const char* name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  std::string refused(const std::string& toml) const {
    put("experiment.toml", toml);
    return message_of<InputError>([&] { read_machine_folder(folder_, machine_); });
  }

  const fs::path folder_ = metastable::test::own_folder();
  Machine machine_ = linear_machine(0.05);
  const std::string toml_ =
      "title = \"a cart\"\nsystem = \"machine\"\n[machine]\nmodel = \"none\"\nlabels = [\"crew\"]\n"
      "inputs = [\"load_kg\"]\n[machine.parameters]\na = { mean = 0.8, sd = 0.05 }\n[columns]\nx = { sd = 0.05 }\n";
};

TEST_F(MachineFolder, HoldsStatesInputsLabelsAndPhases) {
  const MachineRuns runs = read_machine_folder(folder_, machine_);
  ASSERT_EQ(runs.trials.size(), 2u);
  EXPECT_EQ(runs.trials[0].outcome, MachineOutcome::failed);
  EXPECT_FALSE(runs.trials[1].outcome.has_value());
  EXPECT_EQ(runs.trials[0].rows[1].seen, std::vector<double>{1.4});
  EXPECT_EQ(runs.trials[0].rows[1].inputs, std::vector<double>{2.5});
  EXPECT_TRUE(std::isnan(runs.trials[1].rows[0].seen[0]));
  ASSERT_EQ(runs.labels.size(), 1u);
  EXPECT_EQ(runs.labels[0].name, "crew");
  EXPECT_EQ(runs.labels[0].values, (std::vector<std::string>{"day", "night"}));
  EXPECT_EQ(runs.trials[1].rows[0].labels, std::vector<int>{1});
  EXPECT_EQ(runs.trials[1].rows[1].labels, std::vector<int>{-1});
  EXPECT_EQ(runs.phases, (std::vector<std::string>{"up", "down"}));
  EXPECT_EQ(runs.trials[0].rows[1].phase, 1);
}

TEST_F(MachineFolder, LabelsMayBeNamedInTheCall) {
  put("experiment.toml", "system = \"machine\"\n[machine]\nmodel = \"none\"\n");
  EXPECT_EQ(read_machine_folder(folder_, machine_, {"crew"}).labels[0].values.size(), 2u);
  const std::string message = message_of<InputError>([&] { read_machine_folder(folder_, machine_); });
  EXPECT_NE(message.find("steps.csv:1:"), std::string::npos) << message;
  EXPECT_NE(message.find("crew"), std::string::npos) << message;
}

TEST_F(MachineFolder, LabelsHaveNamesOfTheirOwn) {
  const auto called = [&](const std::vector<std::string>& labels) {
    return message_of<InputError>([&] { read_machine_folder(folder_, machine_, labels); });
  };
  const auto stated = [&](const std::string& labels) {
    return refused("system = \"machine\"\n[machine]\nmodel = \"none\"\nlabels = " + labels + "\n");
  };
  const std::string file = (folder_ / "experiment.toml").string() + ": ";
  for (const std::string own : {"x", "load_kg", "trial", "condition", "phase"}) {
    const std::string said = "labels: '" + own + "' is a column of its own: a label needs another name";
    EXPECT_EQ(called({own}), said);
    EXPECT_EQ(stated("[\"" + own + "\"]"), file + said);
    put("experiment.toml", toml_);
  }
  EXPECT_EQ(called({"a", "a"}), "labels: 'a' is there twice");
  EXPECT_EQ(called({""}), "labels: a name is empty");
  EXPECT_EQ(stated("[\"a\", \"a\"]"), file + "labels: 'a' is there twice");
  EXPECT_EQ(stated("[\"\"]"), file + "labels: a name is empty");
}

TEST_F(MachineFolder, AMissingColumnIsOfWhoeverNamesIt) {
  const auto message = [&](const std::vector<std::string>& labels) {
    return message_of<InputError>([&] { read_machine_folder(folder_, machine_, labels); });
  };
  const std::string place = (folder_ / "steps.csv").string() + ":1:1: there is no column ";
  EXPECT_EQ(message({"crew", "floor"}), place + "floor, which labels names");
  put("steps.csv", "trial,step\n1,1\n");
  EXPECT_EQ(message({}), place + "x, which the machine observes\n" + place + "load_kg, which the machine takes\n" +
                             place + "crew, which experiment.toml states");
}

TEST_F(MachineFolder, AnotherMachinesFolderIsRefusedInOneLine) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = toml_;
    changed.replace(changed.find(from), from.size(), to);
    return refused(changed);
  };
  const auto has = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  };
  has(with("mean = 0.8", "mean = 0.9"),
      "machine.parameters.a: 0.9 with sd 0.05, where the machine has 0.8 with sd 0.05: is the folder of another "
      "machine?");
  has(with("a = {", "mass = {"), "machine.parameters.mass: the machine has no such one");
  has(with("sd = 0.05 }\n[", "sd = -1 }\n["), "machine.parameters.a");
  has(with("x = { sd = 0.05 }", "x = { sd = 0.5 }"), "columns.x: sd 0.5, where the machine's sensor has 0.05");
  has(with("[\"load_kg\"]", "[\"volt\"]"), "machine.inputs: volt, where the machine takes load_kg");
  has(with("[\"crew\"]", "\"crew\""), "machine.labels: a list of texts in quotes is expected");
  has(with("\"none\"", "\"compass\""), "machine.model: \"none\" is expected");
  has(with("\"machine\"", "\"rimless_wheel\""), "system: \"machine\" is expected");
}

TEST_F(MachineFolder, WalksOfABuiltInWalkerHaveLabelsToo) {
  WalkOptions options;
  options.trials = 2;
  options.longest = 3;
  WalkFiles files = draw_walks({Walker::compass, 3, 0.3, dynamics::Terrain::fresh}, {}, options, "drawn");
  const std::string model = "model = \"compass\"\n";
  files.experiment_toml.insert(files.experiment_toml.find(model) + model.size(), "labels = [\"floor\"]\n");
  std::string steps;
  for (std::size_t at = 0, line = 0; at < files.steps_csv.size(); ++line) {
    const std::size_t end = files.steps_csv.find('\n', at);
    steps += files.steps_csv.substr(at, end - at) + (line == 0 ? ",floor\n" : line < 4 ? ",oak\n" : ",tiles\n");
    at = end + 1;
  }
  files.steps_csv = steps;
  const auto walks = parse_walks(source_of(files, "walks"));
  ASSERT_EQ(walks->runs.labels.size(), 1u);
  EXPECT_EQ(walks->runs.labels[0].values, (std::vector<std::string>{"oak", "tiles"}));
  EXPECT_EQ(walks->runs.trials[1].rows[0].labels, std::vector<int>{1});
}

}  // namespace
}  // namespace metastable::analysis::test
