#include "analysis/experiment/plausibility.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/experiment_folder.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

class PlausibilityTest : public testing::Test {
 protected:
  PlausibilityTest() {
    setting_.law = dynamics::Law::coulomb;
    trials_ = simulate_trials(setting_, {.trials = 10, .seed = 3});
  }
  // Returns the lines that refuse the trials, spoilt.
  std::vector<std::string> refused(const std::function<void(dynamics::TrialCollision&)>& spoil) const {
    std::vector<dynamics::Trial> trials = trials_;
    for (dynamics::Trial& trial : trials)
      for (dynamics::TrialCollision& c : trial.collisions) spoil(c);
    return refused(trials);
  }
  std::vector<std::string> refused(const std::vector<dynamics::Trial>& trials) const {
    try {
      parse_experiment(source_of(experiment_files(setting_, trials, "t", {}), ""));
    } catch (const InputError& error) {
      return error.lines();
    }
    return {};
  }
  void expect_suspected(const std::string& unit, const std::function<void(dynamics::TrialCollision&)>& spoil) const {
    const std::vector<std::string> lines = refused(spoil);
    ASSERT_FALSE(lines.empty()) << unit;
    EXPECT_LE(lines.size(), 2u) << unit;
    EXPECT_NE(lines.front().find(unit), std::string::npos) << lines.front();
    EXPECT_NE(lines.front().find("suspected"), std::string::npos) << lines.front();
  }
  Setting setting_ = paper_setting(9.59, false);
  std::vector<dynamics::Trial> trials_;
};

TEST_F(PlausibilityTest, TakesWhatAWheelDoes) {
  EXPECT_TRUE(refused(trials_).empty());
  for (const dynamics::Law law : {dynamics::Law::published, dynamics::Law::plastic, dynamics::Law::settled}) {
    PlausibilityTest::setting_.law = law;
    EXPECT_TRUE(refused(simulate_trials(setting_, {.trials = 5, .seed = 3})).empty()) << static_cast<int>(law);
  }
}

TEST_F(PlausibilityTest, SuspectsOtherUnits) {
  using C = dynamics::TrialCollision;
  const auto speeds = [](double by) { return [by](C& c) { c.omega_minus *= by, c.omega_plus *= by; }; };
  expect_suspected("degrees per second", speeds(180 / std::numbers::pi));
  expect_suspected("revolutions per minute", speeds(30 / std::numbers::pi));
  expect_suspected("revolutions per second", speeds(0.5 / std::numbers::pi));
  expect_suspected("milliseconds", [](C& c) { c.time *= 1000; });
  expect_suspected("millimetres", [](C& c) { c.position *= 1000; });
  expect_suspected("centimetres", [](C& c) { c.position *= 100; });
  expect_suspected("inches", [](C& c) { c.position /= 0.0254; });
}

// A frame rate of half its value looks like no unit, and a diameter in the place of a length was explained by inertia.
TEST_F(PlausibilityTest, SuspectsFrameRatesAndDiameters) {
  using C = dynamics::TrialCollision;
  expect_suspected("speeds doubled by a misstated frame rate",
                   [](C& c) { c.omega_minus *= 2, c.omega_plus *= 2, c.time /= 2; });
  setting_.law = dynamics::Law::published;  // Its wheels are slower.
  trials_ = simulate_trials(setting_, {.trials = 10, .seed = 3});
  expect_suspected("speeds halved by a misstated frame rate",
                   [](C& c) { c.omega_minus /= 2, c.omega_plus /= 2, c.time *= 2; });
  for (double& leg : setting_.wheel.leg_length) leg *= 2;
  const std::vector<std::string> lines = refused(trials_);
  ASSERT_FALSE(lines.empty());
  EXPECT_NE(lines.back().find("are wheel.leg_lengths_m all its legs, from the hub to the tips"), std::string::npos)
      << lines.back();
}

TEST_F(PlausibilityTest, NamesTheFirstPositionBeyondTheRamp) {
  std::vector<dynamics::Trial> trials = trials_;
  trials[2].collisions.back().position = 5;
  const std::vector<std::string> lines = refused(trials);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines.front().find("position_m: goes up to 5 m, where the ramp ends at 3.66 m; its steps are those of the"),
            std::string::npos)
      << lines.front();
}

TEST_F(PlausibilityTest, NoticesCopies) {
  std::vector<dynamics::Trial> twice = trials_;
  twice.push_back(trials_[3]);
  ASSERT_EQ(refused(twice).size(), 1u);
  EXPECT_NE(refused(twice).front().find("trial 11 has the speeds of trial 4"), std::string::npos);
  twice = trials_;
  twice.insert(twice.end(), trials_.begin(), trials_.end());
  ASSERT_EQ(refused(twice).size(), 1u);
  EXPECT_NE(refused(twice).front().find("so have 9 more trials"), std::string::npos) << refused(twice).front();
}

TEST_F(PlausibilityTest, SuspectsThatSpeedsBeforeAndAfterAreExchanged) {
  const std::vector<std::string> lines =
      refused([](dynamics::TrialCollision& c) { std::swap(c.omega_minus, c.omega_plus); });
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines.front().find("suspected to be exchanged"), std::string::npos) << lines.front();
}

TEST_F(PlausibilityTest, NamesTheCollisionThatGainsSpeed) {
  std::vector<dynamics::Trial> trials = trials_;
  trials[0].collisions[3].omega_plus = 1.7 * trials[0].collisions[3].omega_minus;
  const std::vector<std::string> lines = refused(trials);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines.front().find("collisions.csv:5:"), std::string::npos) << lines.front();
  EXPECT_NE(lines.front().find("keeps at most"), std::string::npos) << lines.front();
  EXPECT_EQ(lines.front().find("exchanged"), std::string::npos) << lines.front();
}

// A shorter leg turns faster, errors of speeds look like gains, and a wheel that hops gains spin from its hub.
TEST_F(PlausibilityTest, TakesGainsThatAWheelMayHave) {
  std::vector<dynamics::Trial> trials = trials_;
  trials[0].collisions[3].omega_plus = 1.08 * trials[0].collisions[3].omega_minus;
  EXPECT_TRUE(refused(trials).empty());
  const auto noisy = [at = 0.0](dynamics::TrialCollision& c) mutable {
    c.omega_minus += 1.2 * std::sin(at += 1);
    c.omega_plus += 1.2 * std::sin(1.7 * at);
  };
  EXPECT_TRUE(refused(noisy).empty());
  trials[0].collisions[3].omega_plus = 1.7 * trials[0].collisions[3].omega_minus;
  setting_.restitution.mean = 0.8;
  EXPECT_TRUE(refused(trials).empty());
}

// Trials that chance has no part in are alike, and those of a short list of contacts often.
TEST_F(PlausibilityTest, TakesSimulatedTrialsThatAreAlike) {
  setting_.initial_speed.sd = 0;
  setting_.restitution.sd = setting_.friction.sd = 0;
  EXPECT_TRUE(refused(simulate_trials(setting_, {.trials = 5, .seed = 3})).empty());
  setting_.pairs = {{0.4, 0.4}, {0.5, 0.4}};
  EXPECT_TRUE(refused(simulate_trials(setting_, {.trials = 30, .collisions = 3, .seed = 3})).empty());
}

TEST_F(PlausibilityTest, TimesOfOneConditionMayBeInAnotherUnit) {
  std::vector<dynamics::Trial> late = simulate_trials(setting_, {.trials = 6, .seed = 4});
  for (dynamics::Trial& trial : late)
    for (dynamics::TrialCollision& c : trial.collisions) c.time *= 1000;
  try {
    parse_experiment(
        source_of(experiment_files({{"early", setting_, trials_}, {"late", setting_, late}}, "t", {}), ""));
    ADD_FAILURE() << "Times in milliseconds were taken.";
  } catch (const InputError& error) {
    const std::string line = error.lines().front();
    EXPECT_NE(line.find("of condition 'late'"), std::string::npos) << line;
    EXPECT_NE(line.find("milliseconds are suspected"), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace metastable::analysis
