#include "analysis/sensitivity/rigid_body_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynamics/return_map/trials.h"
#include "markov/parallel.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

Setting with_friction(double mean, double sd) {
  Setting setting = paper_setting(9.59, false);
  setting.friction = {mean, sd};
  return setting;
}

// Rolls every wheel to its end, on other random numbers.
Estimate rolled_to_rest(Setting setting, std::size_t trials) {
  setting.law = dynamics::Law::settled;
  const dynamics::SettledMotion motion = setting.motion();
  const dynamics::ContactNoise noise = setting.noise();
  std::vector<double> steps(trials);
  markov::parallel_for(trials, 0, [&](std::size_t t) {
    steps[t] = static_cast<double>(dynamics::steps_to_rest(motion, noise, setting.launch(), 0, 77, t, 1000000));
  });
  double mean = 0, squares = 0;
  for (const double one : steps) mean += one / static_cast<double>(trials);
  for (const double one : steps) squares += (one - mean) * (one - mean);
  const double half = 2 * std::sqrt(squares) / static_cast<double>(trials);
  return {mean, mean - half, mean + half};
}

BesideRigidBodies beside(const std::string& name, Estimate answered, Estimate rolled, bool at_least = false) {
  BesideRigidBodies one{name, answered, {}};
  one.check.steps = rolled;
  one.check.at_least = at_least;
  return one;
}

TEST(RigidBodyCheck, IsTheMeanOfWheelsThatAllRest) {
  const RigidBodyCheck check = rigid_body_check(with_friction(0.4, 0.1), {});
  const Estimate rolled = rolled_to_rest(with_friction(0.4, 0.1), 3000);
  EXPECT_TRUE(check.reason.empty());
  EXPECT_GE(check.rests, 1000U);
  EXPECT_LT(check.steps.lower, rolled.upper);
  EXPECT_GT(check.steps.upper, rolled.lower);
  EXPECT_LT(check.steps.upper / check.steps.lower, 1.3);
}

// On 0.003 deg a wheel of 70 legs loses 0.8 % of its squared speed a step and rests after some 1000, all at once: those
// that are rolled over 512 see no rest, and no rate of rests would tell.
TEST(RigidBodyCheck, HasNoAnswerWhereManyLegsHardlyForgetTheLaunch) {
  Setting setting = paper_setting(7.02, true);
  setting.wheel.leg_length.assign(70, 0.15);
  setting.slope_deg = 0.003;
  setting.restitution = {0.2, 0.05};
  setting.friction = {0.6, 0.05};
  const RigidBodyCheck check = rigid_body_check(setting, {});
  EXPECT_NE(check.reason.find("with 70 legs a launch may show for more than half"), std::string::npos) << check.reason;
  EXPECT_EQ(check.collisions, 0U);
  setting.wheel.leg_length.assign(16, 0.15);
  setting.slope_deg = 5;
  EXPECT_TRUE(rigid_body_check(setting, {.collisions = 1024}).reason.empty());
}

// Wheels are cut off after 512 collisions; every tenth of this setting takes more.
TEST(RigidBodyCheck, CountsWhatIsCutOff) {
  const RigidBodyCheck check = rigid_body_check(with_friction(0.55, 0.1), {.collisions = 32768});
  const Estimate rolled = rolled_to_rest(with_friction(0.55, 0.1), 200);
  EXPECT_LT(check.steps.lower, rolled.upper);
  EXPECT_GT(check.steps.upper, rolled.lower);
  EXPECT_FALSE(check.at_least);
  EXPECT_LT(check.rests, check.wheels);
}

TEST(RigidBodyCheck, IsALowerBoundWhereNoneRests) {
  const RigidBodyCheck check = rigid_body_check(with_friction(0.8, 0.05), {.collisions = 4096});
  EXPECT_EQ(check.rests, 0U);
  EXPECT_TRUE(check.at_least);
  EXPECT_TRUE(std::isinf(check.steps.upper));
  // None of so many rests where their mean is three or less, in 95 %.
  const double late = static_cast<double>(check.collisions - 32 * check.wheels);
  EXPECT_NEAR(check.steps.lower, late / 3, 0.25 * late / 3);
}

TEST(RigidBodyCheck, KnowsAWheelWithoutNoise) {
  Setting setting = with_friction(0.6, 0);
  setting.restitution.sd = 0;
  setting.initial_speed.sd = 0;
  const RigidBodyCheck rolls = rigid_body_check(setting, {});
  EXPECT_TRUE(std::isinf(rolls.steps.lower));
  EXPECT_EQ(rolls.wheels, 1U);
  setting.friction.mean = 0.2;
  const RigidBodyCheck rests = rigid_body_check(setting, {});
  EXPECT_EQ(rests.steps.lower, rests.steps.upper);
  EXPECT_EQ(rests.steps.value, static_cast<double>(rests.collisions));
}

// At this restitution wheels hop down the slope ever faster; following them would take for ever.
TEST(RigidBodyCheck, LeavesWheelsThatHopAway) {
  Setting setting = with_friction(0.4, 0.1);
  setting.restitution = {0.9, 0.05};
  const RigidBodyCheck check = rigid_body_check(setting, {.collisions = 8192});
  EXPECT_GT(check.rests, 0U);
  EXPECT_TRUE(check.at_least);
}

TEST(RigidBodyCheck, SaysWhyThereIsNone) {
  Setting setting = with_friction(0.4, 0.1);
  setting.restitution.mean = 0.97;
  const RigidBodyCheck check = rigid_body_check(setting, {});
  EXPECT_EQ(check.reason, "restitution: mean 0.97 is outside [0, 0.95], the range of law settled");
  EXPECT_EQ(check.wheels, 0U);
  EXPECT_EQ(rigid_body_sentence(std::vector{BesideRigidBodies{"", {1, 1, 1}, check}}, setting.law),
            "No law was named, so the answer is that of published; rigid bodies (law settled) have no answer: "
            "restitution: mean "
            "0.97 is outside [0, 0.95], the range of law settled.");
}

TEST(RigidBodyCheck, IsTheSameOnAnyNumberOfThreads) {
  const RigidBodyCheck one = rigid_body_check(with_friction(0.4, 0.1), {.threads = 1}),
                       two = rigid_body_check(with_friction(0.4, 0.1), {.threads = 2});
  EXPECT_EQ(one.steps.value, two.steps.value);
  EXPECT_EQ(one.steps.upper, two.steps.upper);
  EXPECT_EQ(one.collisions, two.collisions);
}

TEST(RigidBodyCheck, VerdictsTakeWholeIntervals) {
  using enum RigidBodyVerdict;
  EXPECT_EQ(beside("", {100, 99, 101}, {120, 110, 130}).verdict(), within_twice);
  EXPECT_EQ(beside("", {100, 99, 101}, {300, 250, 350}).verdict(), differs);
  EXPECT_EQ(beside("", {100, 99, 101}, {30, 20, 40}).verdict(), differs);
  EXPECT_EQ(beside("", {100, 99, 101}, {190, 150, 230}).verdict(), open);
  EXPECT_EQ(beside("", {100, 99, 101}, {150, 150, infinite}, true).verdict(), open);
  EXPECT_EQ(beside("", {100, 99, 101}, {250, 250, infinite}, true).verdict(), differs);
  EXPECT_EQ(beside("", {infinite, infinite, infinite}, {250, 200, 300}).verdict(), differs);
  EXPECT_EQ(beside("", {infinite, infinite, infinite}, {250, 250, infinite}, true).verdict(), open);
  EXPECT_EQ(beside("", {infinite, infinite, infinite}, {infinite, infinite, infinite}).verdict(), within_twice);
}

TEST(RigidBodyCheck, SentencesNameTheLawAndWhichToTrust) {
  const auto said = [](const std::vector<BesideRigidBodies>& all) {
    return rigid_body_sentence(all, dynamics::Law::published);
  };
  EXPECT_EQ(said({beside("", {1.2, 1.19, 1.21}, {900, 700, 1200})}),
            "No law was named, so the answer is that of published; rigid bodies (law settled) take 900 (95 % interval "
            "700 to 1200) "
            "steps, 750 times as many: trust settled for a real wheel, and published only to compare with the paper.");
  EXPECT_EQ(said({beside("", {6, 5.9, 6.1}, {6.1, 5.8, 6.7})}),
            "No law was named, so the answer is that of published; rigid bodies (law settled) take 6.1 (95 % interval "
            "5.8 to 6.7) "
            "steps, within a factor of two of that.");
  EXPECT_NE(said({beside("", {44800, 44600, 45000}, {20000, 20000, infinite}, true)}).find("do not tell"),
            std::string::npos);
  // Rubber feet on the steeper ramp: more friction is fewer steps under the one law, more under the other.
  const std::vector<BesideRigidBodies> rubber{beside("friction-mean 0.4", {6.13, 6.12, 6.14}, {6.2, 5.8, 6.6}),
                                              beside("friction-mean 0.6", {1.19, 1.18, 1.2}, {900, 700, 1200})};
  EXPECT_NE(said(rubber).find("disagree in direction"), std::string::npos) << said(rubber);
  EXPECT_NE(said(rubber).find("published has fewer at the latter"), std::string::npos) << said(rubber);
  // In the same direction, but by more than twice at one of them.
  const std::vector<BesideRigidBodies> apart{beside("7 deg", {6, 5.9, 6.1}, {7, 6.8, 7.2}),
                                             beside("9 deg", {60, 59, 61}, {200, 190, 210})};
  EXPECT_NE(said(apart).find("differ by more than a factor of two in 1 of 2, most at 9 deg"), std::string::npos)
      << said(apart);
  for (const auto& all : {rubber, apart}) EXPECT_EQ(said(all).find('\n'), std::string::npos);
}

}  // namespace
}  // namespace metastable::analysis
