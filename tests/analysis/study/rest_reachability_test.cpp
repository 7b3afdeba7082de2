#include "analysis/study/rest_reachability.h"

#include <gtest/gtest.h>

#include <cmath>

#include "analysis/study/metastability.h"
#include "dynamics/return_map/trials.h"
#include "markov/chain/chain.h"
#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Setting coulomb(double slope_deg) {
  Setting setting = paper_setting(7.02, true);
  setting.law = dynamics::Law::coulomb;
  setting.slope_deg = slope_deg;
  return setting;
}

// With rebound_lost = 0 a collision leaves k = omega+^2/omega-^2 >= 0.54, whatever eta and mu are. At the fixed point
// of that k, omega+^2 = k/(1 - k) times what a stance adds; it clears the barrier if k/(1 - k) 2 sin(gamma)
// sin(alpha/2) >= 1 - cos(alpha/2 - gamma): from gamma = 3.47 deg on. At 7.02 and 9.59 deg rest would need k < 0.28 and
// 0.17.
TEST(RestReachability, CoulombNeverRestsOnThePapersRamps) {
  for (const double slope : {7.02, 9.59}) {
    const RestReachability reach = rest_reachability(coulomb(slope).problem());
    EXPECT_FALSE(reach.certain);
    ASSERT_TRUE(reach.safe_state);
    EXPECT_LT(std::sqrt(*reach.safe_state), 7.0);
  }
  const auto slope = safe_slope_deg(coulomb(7.02));
  ASSERT_TRUE(slope);
  EXPECT_NEAR(*slope, 3.47, 0.005);
  EXPECT_TRUE(rest_reachability(coulomb(3.4).problem()).certain);
}

TEST(RestReachability, PublishedFrictionWithoutBoundAlwaysReachesRest) {
  const Setting setting = paper_setting(9.59, true);
  EXPECT_TRUE(rest_reachability(setting.problem()).certain);
  EXPECT_FALSE(safe_slope_deg(setting));
}

// The plastic wheel rolls for ever where its fixed point clears the barrier, from launches that clear it at once:
// cos^2(alpha) x >= barrier, for equal legs and a point mass.
TEST(RestReachability, PlasticThresholdIsTheBarrierOfTheFirstStep) {
  Setting setting = paper_setting(9.59, true);
  setting.law = dynamics::Law::plastic;
  const RestReachability reach = rest_reachability(setting.problem());
  EXPECT_FALSE(reach.certain);
  const double alpha = 2 * M_PI / 8, gamma = 9.59 * M_PI / 180;
  const double barrier = 2 * 9.81 / 0.1519 * (1 - std::sin(M_PI / 2 - alpha / 2 + gamma));
  EXPECT_NEAR(*reach.safe_state, barrier / std::pow(std::cos(alpha), 2), 1e-6);
}

TEST(RestReachability, AStudyOfAnEndlessWheelIsInfiniteNotLarge) {
  const Metastability result = study(coulomb(7.02), {.cells = 128, .samples = 4096});
  EXPECT_EQ(result.status, Status::rest_unreachable);
  EXPECT_EQ(result.message, "infinite: rest is unreachable");
  EXPECT_TRUE(std::isinf(result.steps.from_start.value));
  EXPECT_EQ(result.spectrum.failure_rate.value, 0.0);
  EXPECT_NEAR(result.spectrum.moduli.front(), 1.0, 1e-9);
  EXPECT_GT(result.spectrum.mixing_steps, 0.0);
  EXPECT_GT(result.survivors.mean, 4.0);
  ASSERT_TRUE(result.steps.reach_end);
  EXPECT_NEAR(*result.steps.reach_end, 1.0, 1e-9);
}

// Some launches rest, the others never do: both are said.
TEST(RestReachability, SlowLaunchesOfAnEndlessWheelRest) {
  Setting setting = paper_setting(7.02, true);
  setting.law = dynamics::Law::plastic;
  setting.initial_speed = {3, 0.1};
  const Metastability result = study(setting);
  EXPECT_TRUE(std::isinf(result.steps.from_start.value));
  EXPECT_NE(result.message.find("the others rest"), std::string::npos);
  // They rest at once below the threshold speed of the barrier: P(omega_0 < 3.061) for N(3, 0.1^2).
  const double threshold = std::sqrt(*result.steps.safe_state);
  EXPECT_NEAR(*result.steps.reach_end, 0.5 * std::erfc((threshold - 3) / 0.1 / std::sqrt(2.0)), 2e-3);
  EXPECT_EQ(result.steps.distribution.quantile(0.5), 1.0);
}

// It rests out of a slow well, or leaps from there into one that it never leaves: either once in 300,000 steps.
struct TwoWells {
  std::pair<double, double> state_interval(int) const { return {0, 3}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int, std::span<const double> score) const {
    if (state < 1 && score[0] < -leap) return std::nullopt;
    const double well = state < 1 && score[0] < leap ? 0.5 : 2.5;
    return well + 0.4 * std::tanh(score[0]);
  }
  std::optional<std::pair<double, double>> landing_range(double state, int) const {
    return std::pair{state < 1 ? markov::rest_landing : 2.1, 2.9};
  }
  double leap = 4.5;
};

// The launches that are left after 100,000 steps are not those that never rest.
TEST(RestReachability, LaunchesThatRestLateBesideOthersThatNeverDoHaveNoNumber) {
  const auto from_slow = [](double leap) {
    const Problem problem{TwoWells{leap}, {[](double) { return 0.5; }, 0}};
    return study(problem, {.cells = 128, .samples = 4096});
  };
  EXPECT_NE(message_of<markov::ConvergenceError>([&] {
              from_slow(4.5);
            }).find("launches still come to rest after 100000 steps, beside others that never do"),
            std::string::npos);
  EXPECT_EQ(from_slow(2).status, Status::rest_unreachable);
}

// The wheel could roll for ever, but no launch gets that far: once "infinite", or no answer at all.
TEST(RestReachability, LaunchesThatAllRestAreFiniteBesideStatesThatNeverDo) {
  for (const double slope : {7.02, 9.59}) {
    Setting setting = coulomb(slope);
    setting.initial_speed = {1, 0.1};
    for (const Method method : {Method::sampled, Method::integrated}) {
      StudyOptions options;
      options.method = method;
      const Metastability result = study(setting.problem(), options);
      EXPECT_EQ(result.status, Status::converged);
      EXPECT_EQ(result.message.substr(0, 55), "the metastable regime is of wheels that never rest: few");
      EXPECT_TRUE(std::isnan(result.survivors.restart_mean));
      EXPECT_NEAR(result.steps.from_start.value, 1, 1e-12);
      EXPECT_LT(result.steps.survival[1], 1e-15);
      EXPECT_EQ(result.steps.distribution.quantile(0.95), 1);
      EXPECT_TRUE(std::isinf(result.steps.from_quasi_stationary.value));
    }
  }
}

// What the cells make of wheels that all rest at once is no regime (speeds of hundreds of rad/s stood there).
TEST(RestReachability, WhereHardlyAnySurvivesAStepThereIsNoRegime) {
  Setting heavy;
  heavy.friction = {10, 0.1};
  Setting slow = coulomb(5);
  slow.initial_speed = {1, 0.1};
  for (const Setting& setting : {heavy, slow}) {
    const Metastability result = study(setting.problem(), {});
    EXPECT_NEAR(result.steps.from_start.value, 1, 1e-6) << setting.describe();
    EXPECT_TRUE(std::isnan(result.survivors.mean)) << result.survivors.mean;
    for (const ViolationShare& share : result.violations) EXPECT_TRUE(std::isnan(share.quasi_stationary)) << share.name;
  }
}

// The stationary speed does not depend on how the wheel was launched.
TEST(RestReachability, FastLaunchesOfAnEndlessWheelSettle) {
  const double usual = study(coulomb(7.02).problem(), {}).survivors.mean;
  for (const double speed : {50.0, 300.0}) {
    Setting setting = coulomb(7.02);
    setting.initial_speed = {speed, 0.1};
    EXPECT_NEAR(study(setting.problem(), {}).survivors.mean, usual, 2e-4);
  }
}

// Some launches roll for ever; others survive some steps and rest all the same.
TEST(RestReachability, LaunchesOnBothSidesOfTheThresholdAreTold) {
  Setting setting = coulomb(3.6);
  setting.initial_speed = {3.2, 0.1};
  const Metastability result = study(setting.problem(), {});
  EXPECT_TRUE(std::isinf(result.steps.from_start.value));
  double rest = 0;
  const dynamics::WheelMap map = setting.map();
  constexpr int trials = 4000;
  for (std::uint64_t i = 0; i < trials; ++i) rest += dynamics::steps_to_rest(map, setting.launch(), 0, 1, i, 300) < 300;
  rest /= trials;
  EXPECT_NEAR(1 - result.steps.survival.back(), rest, 5 * std::sqrt(rest * (1 - rest) / trials));
}

}  // namespace
}  // namespace metastable::analysis
