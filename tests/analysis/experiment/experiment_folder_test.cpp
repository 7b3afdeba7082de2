#include "analysis/experiment/experiment_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) all.push_back(line);
  return all;
}

TEST(ExperimentFolder, FilesFollowTheFormat) {
  const Setting setting = paper_setting(7.02, false);
  const auto trials = simulate_trials(setting, {.trials = 20, .collisions = 16, .seed = 3});
  const ExperimentFiles files = experiment_files(setting, trials, "A \"test\"", {"made by a test"});
  EXPECT_EQ(lines(files.experiment_toml)[0], "# made by a test");
  EXPECT_NE(files.experiment_toml.find("title = \"A \\\"test\\\"\""), std::string::npos);
  EXPECT_NE(files.experiment_toml.find("law = \"published\""), std::string::npos);
  EXPECT_NE(files.experiment_toml.find("initial_speed_rad_s = { mean = 7.35, sd = 0.19 }"), std::string::npos);
  const auto rows = lines(files.collisions_csv);
  EXPECT_EQ(rows[0], "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s");
  std::size_t collisions = 0;
  for (const dynamics::Trial& trial : trials) collisions += trial.collisions.size();
  EXPECT_EQ(rows.size(), collisions + 1);
  EXPECT_TRUE(rows[1].starts_with("7.02,1,1,0,0.000000,0.000000,"));
  const auto outcomes = lines(files.trials_csv);
  EXPECT_EQ(outcomes[0], "condition,trial,outcome");
  EXPECT_EQ(outcomes.size(), 21u);
  EXPECT_TRUE(std::any_of(outcomes.begin(), outcomes.end(), [](const auto& row) { return row.ends_with(",rest"); }));
}

TEST(ExperimentFolder, TrialsAreTheSameOnAnyNumberOfThreads) {
  const Setting setting = paper_setting(9.59, false);
  const auto text = [&](int threads) {
    return experiment_files(setting, simulate_trials(setting, {.trials = 50, .threads = threads}), "t", {})
        .collisions_csv;
  };
  EXPECT_EQ(text(1), text(4));
}

TEST(ExperimentFolder, RefusesNumbersOutOfRange) {
  const Setting setting = paper_setting(9.59, false);
  EXPECT_THROW(simulate_trials(setting, {.trials = 0}), std::invalid_argument);
  EXPECT_THROW(simulate_trials(setting, {.collisions = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
