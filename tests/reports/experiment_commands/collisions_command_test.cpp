#include "reports/experiment_commands/collisions_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"
#include "reports/experiment_commands/simulate_command.h"
#include "tests/message_of.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {
namespace fs = std::filesystem;

class CollisionsCommandTest : public InFolder {
 protected:
  void simulate() const {
    SimulateRequest request;
    request.trials = 10;
    request.out = folder_.string();
    request.camera.emplace();
    printed([&] { run_simulate(request); });
  }
  std::string run(bool peak = false, int collisions = 16) const {
    CollisionsRequest request;
    request.finder.collisions = collisions;
    request.folder = folder_.string();
    request.peak = peak;
    return printed([&] { run_collisions(request); });
  }
};

TEST_F(CollisionsCommandTest, ComparesWithTheCollisionsThatAreThere) {
  simulate();
  const std::string before = read(folder_ / "collisions.csv");
  const std::string said = run();
  EXPECT_NE(said.find("found (100.00 %), 0 others"), std::string::npos) << said;
  EXPECT_NE(said.find("omega_minus as written:  bias"), std::string::npos) << said;
  EXPECT_EQ(read(folder_ / "collisions.csv"), before);
  EXPECT_TRUE(fs::exists(folder_ / "collisions-from-angle.csv"));
  EXPECT_TRUE(fs::exists(folder_ / "collisions-from-angle-details.csv"));
}

TEST_F(CollisionsCommandTest, MakesAFolderThatCanBeReadInFull) {
  simulate();
  const analysis::Experiment known = analysis::read_experiment(folder_);
  fs::remove(folder_ / "collisions.csv");
  run(true);
  const analysis::Experiment found = analysis::read_experiment(folder_);
  EXPECT_EQ(found.collisions(), known.collisions());
  EXPECT_EQ(found.columns.leg, analysis::Presence::all);
  EXPECT_EQ(found.columns.position, analysis::Presence::all);
  for (std::size_t t = 0; t < found.trials.size(); ++t)
    EXPECT_NEAR(*found.trials[t].collisions.back().position, *known.trials[t].collisions.back().position, 2e-6);
  EXPECT_LT(found.trials[0].collisions[0].omega_minus, known.trials[0].collisions[0].omega_minus - 0.1);  // the peak
}

// Trials of the default contact rest after a few collisions: cut before, they would seem to rest too early.
TEST_F(CollisionsCommandTest, SaysWhereACutHidesThatATrialRollsOn) {
  simulate();
  EXPECT_EQ(run().find("roll on"), std::string::npos);
  const analysis::Experiment known = analysis::read_experiment(folder_);
  std::size_t longer = 0;
  for (const analysis::MeasuredTrial& trial : known.trials) longer += trial.collisions.size() > 2;
  ASSERT_GT(longer, 0u);
  fs::remove(folder_ / "collisions.csv");
  EXPECT_NE(
      run(false, 2).find(std::to_string(longer) + " trials that trials.csv lists as rest roll on after collision 2"),
      std::string::npos);
}

TEST_F(CollisionsCommandTest, LeavesNothingBehindWhenTheInputIsBad) {
  simulate();
  fs::remove(folder_ / "collisions.csv");
  std::ofstream(folder_ / "angle.csv", std::ios::app) << "7.02,1,zero,0\n";
  EXPECT_THROW(run(), analysis::InputError);
  std::ofstream(folder_ / "angle.csv") << "trial,time_s,angle_rad\n1,0,0\n1,1,0\n";
  fs::remove(folder_ / "trials.csv");
  EXPECT_THROW(run(), std::invalid_argument);  // 1 Hz
  EXPECT_FALSE(fs::exists(folder_ / "collisions.csv"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
}

// Times of half the camera's rate gave speeds that no wheel keeps up, and exit code 0.
TEST_F(CollisionsCommandTest, RefusesSpeedsThatNoWheelKeepsUp) {
  simulate();
  std::istringstream lines(read(folder_ / "angle.csv"));
  std::string slowed, line;
  std::getline(lines, line);
  slowed = line + "\n";
  while (std::getline(lines, line)) {
    const std::size_t second = line.find(',', line.find(',') + 1) + 1, third = line.find(',', second);
    slowed += line.substr(0, second) + std::to_string(2 * std::stod(line.substr(second, third - second))) +
              line.substr(third) + "\n";
  }
  std::ofstream(folder_ / "angle.csv") << slowed;
  EXPECT_NE(message_of([&] { run(); }).find("is time_s in seconds"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "collisions-from-angle.csv"));
}

}  // namespace
}  // namespace metastable::reports::test
