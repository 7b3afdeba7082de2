#include "analysis/study/setting.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <stdexcept>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/sensitivity/comparison.h"
#include "analysis/study/certify.h"
#include "analysis/study/metastability.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

TEST(Setting, DefaultsAreThePapers) {
  const Setting setting;
  EXPECT_EQ(setting.wheel.legs(), 8);
  EXPECT_DOUBLE_EQ(setting.wheel.hub_mass, 1.39);
  EXPECT_EQ(setting.describe(),
            "7.02 deg, legs 0.1524, 0.1524, 0.1514, 0.1514, 0.1516, 0.1508, 0.1524, 0.1528 m, law published, "
            "eta ~ N(0.4, 0.1^2), mu ~ N(0.4, 0.1^2), omega_0 ~ N(7.35, 0.19^2) rad/s");
  EXPECT_EQ(setting.problem().last_event, 32);  // 31 chords of 0.1163 m fit on 3.66 m
  EXPECT_DOUBLE_EQ(paper_launch(9.59)->mean, 5.83);
  EXPECT_FALSE(paper_launch(8.0));
}

TEST(Setting, ErrorsNameTheQuantityAndItsRange) {
  const auto expect_message = [](const std::function<void(Setting&)>& change, const std::string& part) {
    Setting setting;
    change(setting);
    const std::string said = message_of([&] { setting.problem(); });
    EXPECT_NE(said.find(part), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos);
  };
  expect_message([](Setting& s) { s.slope_deg = 25; }, "22.5");
  expect_message([](Setting& s) { s.slope_deg = 0; }, "slope");
  expect_message([](Setting& s) { s.restitution.sd = -1; }, "-1");
  expect_message([](Setting& s) { s.friction = {-5, 0.01}; }, "friction");
  expect_message([](Setting& s) { s.initial_speed.mean = -2; }, "initial speed");
  expect_message([](Setting& s) { s.wheel.leg_length = {0.1, 0.1}; }, "leg");
  expect_message([](Setting& s) { s.ramp_length = 0; }, "ramp length");
  expect_message([](Setting& s) { s.first_landing_leg = 8; }, "first landing leg: 8 is outside 0..7");
  expect_message([](Setting& s) { s.rebound_lost = 2; }, "rebound");
  expect_message([](Setting& s) { s.correlation = 1; }, "correlation");
  // No wheel has these, but the arithmetic would take them.
  expect_message([](Setting& s) { s.wheel.hub_mass = 1e250; }, "hub_mass: 1e+250 kg is outside [1e-06, 1e+06]");
  expect_message([](Setting& s) { s.wheel.leg_length[3] = 1e9; },
                 "leg_length[3]: 1000000000 m is outside [0.001, 100]");
  expect_message([](Setting& s) { s.wheel.inertia = 0.0035; }, "inertia: 0.0035 kg m^2 is below M (mean L)^2");
  expect_message([](Setting& s) { s.wheel.radius_of_gyration = 5; }, "radius_of_gyration: 5 m is outside");
  expect_message(
      [](Setting& s) {
        s.initial_speed = {1e200, 1};
      },
      "initial speed: mean 1e+200 rad/s is outside [0, 1000]");
  expect_message([](Setting& s) { s.friction.mean = 40; }, "friction: mean 40 is outside [0, 10]");
  expect_message([](Setting& s) { s.restitution.mean = 1.4; }, "restitution: mean 1.4 is outside [0, 1]");
  expect_message([](Setting& s) { s.pairs = {{.restitution = 0.4, .friction = 100}}; }, "pairs[0]: friction 100 is");
  expect_message([](Setting& s) { s.ramp_length = 1e9; }, "ramp length: 1000000000 m is outside [0.001, 100000]");
  Setting endless;
  endless.ramp_length = std::numeric_limits<double>::infinity();
  EXPECT_NO_THROW(endless.validate());
}

TEST(Setting, SettledHasItsRanges) {
  Setting setting;
  setting.law = dynamics::Law::settled;
  EXPECT_NO_THROW(setting.validate());
  setting.restitution.mean = 0.96;
  EXPECT_THROW(setting.validate(), std::invalid_argument);
  setting.restitution.mean = 0.4;
  setting.wheel.tip_radius = 0.01;  // more than a twentieth of the shortest leg
  EXPECT_THROW(setting.validate(), std::invalid_argument);
}

TEST(Setting, IsCheckedWhereverTheLibraryTakesOne) {
  Setting setting;
  setting.wheel.gravity = 1e9;
  EXPECT_THROW(study(setting), std::invalid_argument);
  EXPECT_THROW(compare({setting, setting}, {}), std::invalid_argument);
  EXPECT_THROW(simulate_trials(setting, {}), std::invalid_argument);
  EXPECT_THROW(certify(setting), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
