#include "analysis/study/integrated_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/sensitivity/comparison.h"
#include "analysis/study/setting.h"
#include "dynamics/return_map/rough_terrain.h"
#include "dynamics/return_map/trials.h"
#include "markov/transition_rows/collocation.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/state_space.h"
#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Setting equal_legs(double slope_deg, Spread friction) {
  Setting setting;
  setting.wheel.leg_length.assign(8, 0.1519);
  setting.slope_deg = slope_deg;
  setting.friction = friction;
  setting.initial_speed = *paper_launch(slope_deg);
  return setting;
}

Metastability integrated(const Setting& setting, double tolerance, std::size_t cells = 0) {
  StudyOptions options;
  options.method = Method::integrated;
  options.tolerance = tolerance;
  options.cells = cells;
  return study(setting, options);
}

TEST(IntegratedStudy, GivesTheKnownAnswersOfThePapersWheel) {
  // Direct simulation gives 4.26 and 6.17 (tests/dynamics/return_map/trials_test.cpp); sampling and extrapolation
  // 4.2585(1), 6.1746(2).
  const Metastability flat = integrated(equal_legs(7.02, {0.4, 0.1}), 1e-3);
  EXPECT_EQ(flat.method, Method::integrated);
  EXPECT_EQ(flat.status, Status::converged);
  EXPECT_EQ(flat.steps.sampling_error, 0);
  EXPECT_NEAR(flat.steps.from_start.value, 4.2585, 1e-4);
  EXPECT_NEAR(flat.steps.distribution.mean / flat.steps.from_start.value, 1, 1e-12);
  EXPECT_NEAR(integrated(equal_legs(9.59, {0.4, 0.1}), 1e-3).steps.from_start.value, 6.1746, 2e-4);
}

TEST(IntegratedStudy, GivesEightDigitsWithFewNodes) {
  // LandingDensity, an adaptive integral for each pair of nodes, gives 4.2584828629 on 256 nodes of equal panels.
  const Metastability result = integrated(equal_legs(7.02, {0.4, 0.1}), 1e-8);
  EXPECT_EQ(result.status, Status::converged);
  EXPECT_LE(result.cells, 128u);
  EXPECT_NEAR(result.steps.from_start.value / 4.2584828629, 1, 1e-8);
}

TEST(IntegratedStudy, IsRightWhereFailuresAreRare) {
  // Sampled and extrapolated it is 46577.7(50).
  EXPECT_NEAR(integrated(equal_legs(9.59, {0.3, 0.05}), 1e-3).steps.from_start.value, 46577.7, 5);
}

TEST(IntegratedStudy, ErrorCoversFinerNodes) {
  const Setting setting = equal_legs(7.02, {0.3, 0.05});
  const Metastability coarse = integrated(setting, 0.5, 48), fine = integrated(setting, 0.5, 96);
  EXPECT_EQ(coarse.cells, 48u);
  EXPECT_LT(std::abs(std::log(coarse.steps.from_start.value / fine.steps.from_start.value)),
            coarse.steps.discretization_error);
  EXPECT_LT(fine.steps.discretization_error, 0.1 * coarse.steps.discretization_error + 1e-5);  // the rows' own
}

TEST(IntegratedStudy, ReproducesTheSixtyDigitValuesOfRoughTerrain) {
  constexpr double degree = std::numbers::pi / 180;
  const dynamics::RoughTerrainWheel wheel({.mean_slope_rad = 8 * degree, .sd_slope_rad = 1.5 * degree});
  const double start = wheel.fixed_point();
  StudyOptions options;
  options.method = Method::integrated;
  options.tolerance = 1e-11;
  const Metastability result =
      study({wheel, {[start](double) { return start; }, 0}, [](double x) { return x; }, {}}, options);
  EXPECT_EQ(result.status, Status::converged);
  EXPECT_NEAR(result.spectrum.failure_rate.value / 1.5280057867965971e-6, 1, 1e-11);
  EXPECT_NEAR(result.steps.from_start.value / 654449.43992398285, 1, 1e-11);
}

TEST(IntegratedStudy, ComparisonsHaveNoSamplingError) {
  StudyOptions options;
  options.method = Method::integrated;
  options.cells = 32;
  const Comparison comparison = compare({equal_legs(7.02, {0.4, 0.1}), equal_legs(9.59, {0.4, 0.1})}, options);
  const Estimate ratio = *comparison.contrasts.front().ratio;
  EXPECT_NEAR(ratio.value, 6.1746 / 4.2585, 0.01);
  EXPECT_LT(ratio.upper - ratio.lower, 0.1);
}

// These are settings where two levels once agreed by chance, or the changes fell faster than the error. The values are
// those of metastable steps --slope 7.02 --friction 0.3,0.02 --legs 0.1519 --initial-speed 7.35,0.19 --method
// integrated --tolerance 1e-6, and so on.
TEST(IntegratedStudy, IntervalsHoldTheValueOfATighterTolerance) {
  struct Case {
    double slope_deg;
    Spread friction;
    double from_start, failure_rate, worst_start;
  };
  for (const Case& c : {Case{7.02, {0.3, 0.02}, 378935463790697.75, 2.6389717921792634e-15, 378935463378158.7},
                        {8.4, {0.3, 0.1}, 33.95670727473382, 0.03069388388922982, 31.36558499634108},
                        {9.59, {0.25, 0.14}, 29.228159382245774, 0.03496531306606538, 27.83307156361941},
                        {9.59, {0.36, 0.02}, 332077188971.45374, 3.011348063713347e-12, 332077188382.8878}}) {
    Setting setting = equal_legs(7.02, c.friction);
    setting.slope_deg = c.slope_deg;
    for (const double tolerance : {1e-3, 1e-4, 1e-5}) {
      const Metastability coarse = integrated(setting, tolerance);
      EXPECT_EQ(coarse.status, Status::converged);
      EXPECT_LE(coarse.cells, tolerance < 2e-5 ? 192u : 128u)
          << c.slope_deg << ' ' << c.friction.mean << ' ' << c.friction.sd;
      for (const auto& [rough, exact] : {std::pair(coarse.steps.from_start, c.from_start),
                                         {coarse.spectrum.failure_rate, c.failure_rate},
                                         {coarse.steps.worst_start, c.worst_start}}) {
        EXPECT_LE(rough.lower, exact) << c.slope_deg << ' ' << c.friction.mean << ' ' << tolerance;
        EXPECT_GE(rough.upper, exact) << c.slope_deg << ' ' << c.friction.mean << ' ' << tolerance;
      }
    }
  }
}

TEST(IntegratedStudy, TakesLaunchesSlowerThanAnySurvivor) {
  for (const double friction : {0.3, 0.36}) {
    Setting setting = equal_legs(8.4, {friction, 0.14});
    setting.initial_speed = {6, 0.3};  // some 8 sds below the mean, slower than the slowest landing
    const Metastability fine = integrated(setting, 1e-6);
    EXPECT_EQ(fine.status, Status::converged);
    StudyOptions sampled;
    sampled.tolerance = 0.01;
    const Metastability drawn = study(setting, sampled);
    EXPECT_NEAR(fine.steps.from_start.value / drawn.steps.from_start.value, 1, 0.01) << friction;
  }
}

// The bounds are those of `metastable steps --initial-speed 1,3 --certify`: a launch wider than its landings.
TEST(IntegratedStudy, TakesLaunchesWiderThanTheirLandings) {
  Setting setting;  // the paper's legs at 7.02 deg
  setting.initial_speed = {1, 3};
  const Estimate by_density = integrated(setting, 1e-4).steps.from_start,
                 collocated = integrated(setting, 1e-6).steps.from_start;
  EXPECT_GE(by_density.lower, 1.800719);
  EXPECT_LE(by_density.upper, 1.80545);
  EXPECT_LE(collocated.lower, by_density.upper);
  EXPECT_GE(collocated.upper, by_density.lower);
}

TEST(IntegratedStudy, TakesCoulomb) {
  Setting setting = equal_legs(3.0, {0.4, 0.1});
  setting.law = dynamics::Law::coulomb;
  setting.initial_speed = {4.5, 0.2};
  const Metastability result = integrated(setting, 1e-8);
  EXPECT_EQ(result.status, Status::converged);
  // Direct simulation gives 24.68 (s.e. 0.03), tests/dynamics/return_map/trials_test.cpp. The digits are of 24 panels
  // of 16 nodes between edges of three generations, and 30 points a panel of eta and mu: 24.67743312.
  EXPECT_NEAR(result.steps.from_start.value, 24.68, 0.09);
  EXPECT_NEAR(result.steps.from_start.value / 24.67743312, 1, 1e-9);
  EXPECT_NEAR(result.steps.distribution.mean / result.steps.from_start.value, 1, 1e-12);
  EXPECT_LT(result.steps.solver_disagreement, 1e-12);
}

// Friction or restitution is constant, or spreads reach their bounds.
TEST(IntegratedStudy, TakesAnyNoise) {
  struct Case {
    dynamics::Law law;
    double slope_deg;
    Spread restitution, friction, speed;
  };
  using enum dynamics::Law;
  for (const Case& c : {Case{published, 7.02, {0.4, 0}, {0.4, 0.1}, {7.35, 0.19}},
                        {published, 9.59, {0.4, 0.2}, {0.4, 0.2}, {5.83, 0.28}},
                        {coulomb, 3, {0.4, 0.2}, {0.4, 0}, {4.5, 0.2}},
                        {coulomb, 3, {0.4, 0.2}, {0.4, 0.2}, {4.5, 0}}}) {
    Setting setting = equal_legs(c.slope_deg, c.friction);
    setting.law = c.law;
    setting.restitution = c.restitution;
    setting.initial_speed = c.speed;
    const Metastability fine = integrated(setting, 1e-8), coarse = integrated(setting, 1e-4);
    EXPECT_EQ(fine.status, Status::converged) << law_name(c.law) << ' ' << c.restitution.sd << ' ' << c.friction.sd;
    EXPECT_LE(coarse.steps.from_start.lower, fine.steps.from_start.value);
    EXPECT_GE(coarse.steps.from_start.upper, fine.steps.from_start.value);
  }
}

// metastable steps --restitution 0.4,0.2 --friction 0.45,0 --legs 0.1519 --tolerance 0.001 says 3.33529 (3.33441
// to 3.33617).
// It is the paper's Fig. 6.
TEST(IntegratedStudy, OfConstantFrictionAgreesWithSampling) {
  Setting setting = equal_legs(7.02, {0.45, 0});
  setting.restitution = {0.4, 0.2};
  EXPECT_NEAR(integrated(setting, 1e-3).steps.from_start.value, 3.33529, 9e-4);
}

// Densities and collocation share the law's formula and nothing else.
TEST(IntegratedStudy, DensitiesAgreeWithCollocation) {
  for (const Spread& friction : {Spread{0.4, 0.1}, {0.3, 0.05}}) {
    const Metastability densities = integrated(equal_legs(7.02, friction), 2e-5, 128),
                        points = integrated(equal_legs(7.02, friction), 1e-8);
    EXPECT_NEAR(densities.steps.from_start.value / points.steps.from_start.value, 1, 1e-8);
    EXPECT_NEAR(densities.spectrum.failure_rate.value / points.spectrum.failure_rate.value, 1, 1e-8);
  }
}

TEST(IntegratedStudy, NamesTheReasonWhereThereAreNoRows) {
  Setting setting = equal_legs(7.02, {0.4, 0.1});
  setting.correlation = 0.5;
  EXPECT_NE(message_of([&] { integrated(setting, 0.01); }).find("correlated restitution and friction"),
            std::string::npos);
}

double simulated(const Setting& setting, int trials) {
  const dynamics::WheelMap map = setting.map();
  double sum = 0;
  for (int i = 0; i < trials; ++i)
    sum +=
        static_cast<double>(dynamics::steps_to_rest(map, setting.launch(), 0, 7, static_cast<std::uint64_t>(i), 1000));
  return sum / trials;
}

// Hardly anybody survives a revolution: survival from the slow states falls below what doubles hold.
TEST(IntegratedStudy, ARampWithoutSlopeHasItsAnswer) {
  Setting setting;
  setting.slope_deg = 0.001;
  setting.initial_speed = {5, 0.3};
  const Metastability result = integrated(setting, 1e-3);
  EXPECT_EQ(result.status, Status::converged);
  EXPECT_NEAR(result.steps.from_start.value, simulated(setting, 40000), 5 * 0.471 / std::sqrt(40000));  // sd 0.471
  EXPECT_NEAR(result.steps.from_quasi_stationary.value, 1, 1e-6);
}

// Without noise the expected steps are a staircase in the launch speed, here of 13 steps: each has an edge of its own.
TEST(IntegratedStudy, AFastLaunchWithoutNoiseIsExact) {
  Setting setting;
  setting.law = dynamics::Law::plastic;
  setting.slope_deg = 2.67;
  setting.wheel.leg_length.assign(8, 0.2307);
  setting.initial_speed = {94.8, 1.9};
  const dynamics::WheelMap map = setting.map();
  constexpr int shares = 20000;
  double sum = 0;
  for (int k = 0; k < shares; ++k) {
    const double omega =
        setting.initial_speed.mean + setting.initial_speed.sd * markov::normal_score((k + 0.5) / shares);
    std::optional<double> state = omega * omega;
    const std::vector<double> none(static_cast<std::size_t>(map.noise_dimension()), 0.0);
    for (; state; ++sum) state = map.landing(*state, 0, none);
  }
  EXPECT_NEAR(integrated(setting, 0.05).steps.from_start.value, sum / shares, 2e-4);  // a step of the staircase is 1
}

// Cells that only the launch passes lead back into themselves as often as the others survive.
TEST(IntegratedStudy, RangesAreFoundWhereTheSurvivorsOfCellsDoNotSettle) {
  Setting setting = gentle_coulomb();
  setting.slope_deg = 0.17198217060336954;
  setting.restitution = {0.6982241123734467, 0.1638539202239025};
  setting.friction = {0.16948030764114325, 0.0869723477633949};
  setting.initial_speed = {43.359397516838136, 0.027145300481685675};
  const Problem problem = setting.problem();
  const double bulk = 2 * markov::bulk_below_launch(problem.map, problem.launch, 1);
  const auto ranges = markov::collocation_ranges(problem.map, problem.launch, 1, bulk);
  ASSERT_EQ(ranges.size(), 1u);
  EXPECT_GT(ranges[0].second, 0.54 * 43 * 43);  // what `coulomb` leaves of the launch at least
}

TEST(IntegratedStudy, LeavesUnreachableRestToTheSampledStudy) {
  Setting setting = equal_legs(9.59, {0.4, 0.1});
  setting.law = dynamics::Law::coulomb;
  const Metastability result = integrated(setting, 0.01, 64);
  EXPECT_EQ(result.status, Status::rest_unreachable);
  EXPECT_EQ(result.method, Method::sampled);
}

TEST(IntegratedStudy, SpreadsTooNarrowForItsNodesAreRefusedWithTheWayOut) {
  Setting setting;
  setting.friction = {0.4, 1e-9};
  EXPECT_EQ(message_of([&] { study(setting, {.method = Method::integrated}); }),
            "friction: sd 1e-09 is too narrow for method integrated, which takes 0 and 0.001 or more; method "
            "sampled takes any");
}

}  // namespace
}  // namespace metastable::analysis
