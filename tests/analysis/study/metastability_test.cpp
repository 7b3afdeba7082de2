#include "analysis/study/metastability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "dynamics/return_map/rough_terrain.h"
#include "dynamics/return_map/trials.h"
#include "markov/chain/elimination.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/discretization.h"
#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Setting equal_legs_under_coulomb(double slope_deg, double leg, Spread restitution, Spread friction, Spread launch) {
  Setting setting;
  setting.slope_deg = slope_deg;
  setting.law = dynamics::Law::coulomb;
  setting.wheel.leg_length.assign(8, leg);
  setting.restitution = restitution;
  setting.friction = friction;
  setting.initial_speed = launch;
  return setting;
}

struct Sample {
  double mean = 0, sd = 0, error = 0;
};

Sample sample(const std::vector<double>& values) {
  const auto n = static_cast<double>(values.size());
  Sample s;
  s.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  for (const double v : values) s.sd += (v - s.mean) * (v - s.mean);
  s.sd = std::sqrt(s.sd / (n - 1));
  s.error = s.sd / std::sqrt(n);
  return s;
}

// Holds what whole trials came to, all of which rest.
struct WholeTrials {
  std::vector<double> steps, seconds, metres;
  double beyond_end = 0;  // trials of more than the 32 collisions on 3.66 m
  double lifted = 0;      // share of the collisions beside which gravity alone does not hold the standing foot
};

bool lifts(const dynamics::WheelMap& map, const dynamics::Wheel& wheel, const dynamics::TrialCollision& c) {
  const int stance = (c.leg + 7) % 8;
  const auto beyond = [](double omega, double length, double angle) {
    return omega * omega * length > 9.81 * std::sin(angle);
  };
  return beyond(c.omega_minus, wheel.leg_length[static_cast<std::size_t>(stance)],
                map.triangle(c.leg).beta_first_rad - map.slope()) ||
         beyond(c.omega_plus, wheel.leg_length[static_cast<std::size_t>(c.leg)],
                map.triangle(c.leg).beta_second_rad + map.slope());
}

WholeTrials whole_trials(const Setting& setting, int count) {
  WholeTrials all;
  const dynamics::WheelMap map = setting.map();
  double collisions = 0;
  for (const dynamics::Trial& trial : simulate_trials(setting, {.trials = count, .collisions = 100000, .seed = 5})) {
    EXPECT_EQ(trial.outcome, dynamics::Outcome::rest);
    all.steps.push_back(static_cast<double>(trial.collisions.size()));
    all.seconds.push_back(trial.collisions.back().time);
    all.metres.push_back(trial.collisions.back().position);
    all.beyond_end += trial.collisions.size() > 32;
    collisions += all.steps.back();
    for (const dynamics::TrialCollision& c : trial.collisions) all.lifted += lifts(map, setting.wheel, c);
  }
  all.lifted /= collisions;
  return all;
}

// The chain's quantile has the level it claims among the trials, up to sampling and the lumps of whole steps.
void expect_accumulated(const Accumulated& total, std::vector<double> values) {
  const Sample s = sample(values);
  EXPECT_NEAR(total.mean, s.mean, 4 * s.error + 0.002 * s.mean);
  EXPECT_NEAR(total.sd, s.sd, 0.03 * s.sd);
  std::sort(values.begin(), values.end());
  const auto below = [&values](double v) {
    return static_cast<double>(std::upper_bound(values.begin(), values.end(), v) - values.begin()) /
           static_cast<double>(values.size());
  };
  ASSERT_EQ(total.quantiles.size(), 5u);
  for (const auto& [level, value] : total.quantiles) {
    EXPECT_GE(below(value * (1 + 1e-3) + 1e-6), level - 0.02);
    EXPECT_LE(below(value * (1 - 1e-3) - 1e-6), level + 0.02);
  }
}

// The chain agrees with whole trials that share nothing with it but the map: uneven legs, defaults of the program.
TEST(Metastability, AgreesWithMonteCarloTrials) {
  Setting setting = paper_setting(9.59, false);
  setting.ramp_length = 3.66;
  const Metastability chain = study(setting);
  setting.ramp_length = std::numeric_limits<double>::infinity();  // trials go on to rest
  constexpr int count = 40000;
  const WholeTrials trials = whole_trials(setting, count);
  expect_accumulated(chain.steps.distribution, trials.steps);
  ASSERT_TRUE(chain.steps.seconds && chain.steps.metres);
  expect_accumulated(*chain.steps.seconds, trials.seconds);
  expect_accumulated(*chain.steps.metres, trials.metres);
  const Sample s = sample(trials.steps);
  EXPECT_NEAR(chain.steps.from_start.value, s.mean, 4 * s.error + 0.002 * s.mean);
  ASSERT_TRUE(chain.steps.reach_end);
  EXPECT_NEAR(*chain.steps.reach_end, trials.beyond_end / count, 4 * std::sqrt(trials.beyond_end) / count + 1e-4);
  for (const int n : {1, 3, 10}) {
    const double alive =
        static_cast<double>(std::ranges::count_if(trials.steps, [n](double v) { return v > n; })) / count;
    EXPECT_NEAR(chain.steps.survival[static_cast<std::size_t>(n)], alive,
                4 * std::sqrt(alive * (1 - alive) / count) + 5e-4);
  }
  ASSERT_FALSE(chain.violations.empty());
  EXPECT_NEAR(chain.violations[0].until_rest, trials.lifted, 0.01);
}

// With uneven legs it holds the one-revolution product against elimination on the full (leg, omega^2) chain.
TEST(Metastability, RevolutionProductAgreesWithTheFullChain) {
  const Problem problem = paper_setting(7.02, false).problem();
  const markov::StateSpace space = markov::covering_space(problem.map, problem.launch, 48, 1);
  const markov::SampledChain sampled =
      markov::discretize(problem.map, space, problem.launch, {.draws = {.count = 2048}});
  const markov::ChainSolver product(sampled.chain);
  ASSERT_EQ(product.period().period, 8);
  const std::vector<double> ones(space.size(), 1.0);
  const std::vector<double> by_product = product.solve(ones), full = markov::Elimination(sampled.chain).solve(ones);
  for (std::size_t i = 0; i < full.size(); ++i) EXPECT_NEAR(by_product[i] / full[i], 1.0, 1e-12);
  // The rate per step is of one step of the full chain from the per-leg quasi-stationary distributions, leg by leg.
  const markov::QuasiStationary quasi = markov::quasi_stationary(product);
  const std::vector<double> shares = markov::shares_in_classes(product.period(), quasi.distribution);
  double survives = 1;
  for (int p = 0; p < 8; ++p) {
    double rest = 0;
    for (std::size_t c = 0; c < space.cells(); ++c)
      rest += shares[space.index(p, c)] * sampled.chain.kill(space.index(p, c));
    survives *= 1 - rest;
  }
  EXPECT_NEAR(quasi.failure_rate, 1 - std::pow(survives, 1.0 / 8), 1e-10);
}

TEST(Metastability, EqualLegsInOnePhaseAndNearlyEqualLegsInEightAgree) {
  Setting one = paper_setting(9.59, true), eight = one;
  eight.wheel.leg_length[3] *= 1 + 1e-9;
  StudyOptions options;
  options.tolerance = 0.003;
  const Metastability a = study(one, options), b = study(eight, options);
  EXPECT_EQ(a.phases, 1);
  EXPECT_EQ(b.phases, 8);
  EXPECT_EQ(b.spectrum.period, 8);
  EXPECT_NEAR(a.steps.from_start.value / b.steps.from_start.value, 1.0, 0.006);
  EXPECT_NEAR(a.survivors.mean, b.survivors.mean, 0.01);
  EXPECT_NEAR(a.spectrum.moduli[0], b.spectrum.moduli[0], 2e-3);
  EXPECT_NEAR(a.spectrum.mixing_steps / b.spectrum.mixing_steps, 1.0, 0.1);
}

// Cells are small where they matter: at the same number of cells the graded ones are the better ones.
TEST(Metastability, GradedCellsBeatEqualOnesOnTheWheel) {
  Setting setting = paper_setting(7.02, true);
  setting.friction = {0.3, 0.05};
  const Problem problem = setting.problem();
  const markov::DrawOptions draws{.count = 16384};
  const auto log_rate = [&](const markov::StateSpace& space) {
    const markov::SampledChain sampled =
        markov::discretize(problem.map, space, problem.launch, {.draws = draws, .threads = 2});
    return std::log(markov::quasi_stationary(markov::ChainSolver(sampled.chain)).failure_rate);
  };
  const markov::StateSpace pilot = markov::covering_space(problem.map, problem.launch, 96, 1);
  const markov::SampledChain sampled = markov::discretize(problem.map, pilot, problem.launch, {.draws = draws});
  const markov::QuasiStationary quasi = markov::quasi_stationary(markov::ChainSolver(sampled.chain));
  const markov::StateSpace graded =
      markov::graded_space(pilot, quasi.distribution, quasi.survival_weight, sampled.launch.after, 32);
  const double reference = log_rate(markov::covering_space(problem.map, problem.launch, 768, 1));
  const double equal = log_rate(markov::covering_space(problem.map, problem.launch, 32, 1));
  EXPECT_LT(std::abs(log_rate(graded) - reference), 0.5 * std::abs(equal - reference));
}

TEST(Metastability, BitsDoNotDependOnThreads) {
  const Problem problem = paper_setting(7.02, false).problem();
  StudyOptions options;
  options.cells = 32;
  options.samples = 512;
  options.threads = 1;
  const Metastability one = study(problem, options);
  for (const int threads : {2, 3}) {
    options.threads = threads;
    const Metastability other = study(problem, options);
    EXPECT_EQ(one.steps.from_start.value, other.steps.from_start.value);
    EXPECT_EQ(one.steps.from_start.upper, other.steps.from_start.upper);
    EXPECT_EQ(one.spectrum.moduli, other.spectrum.moduli);
    EXPECT_EQ(one.steps.survival, other.steps.survival);
    EXPECT_EQ(one.survivors.by_phase.back().mass, other.survivors.by_phase.back().mass);
  }
}

TEST(Metastability, ResultsHangTogether) {
  const Metastability result = study(paper_setting(9.59, false), {});
  EXPECT_EQ(result.status, Status::converged);
  EXPECT_DOUBLE_EQ(result.spectrum.failure_rate.value * result.steps.from_quasi_stationary.value, 1.0);
  EXPECT_LE(result.steps.worst_start.value, result.steps.from_quasi_stationary.value);
  EXPECT_NEAR(result.spectrum.moduli.front(), 1 - result.spectrum.failure_rate.value, 2e-3);
  EXPECT_TRUE(std::is_sorted(result.spectrum.moduli.rbegin(), result.spectrum.moduli.rend()));
  EXPECT_TRUE(std::is_sorted(result.steps.survival.rbegin(), result.steps.survival.rend()));
  EXPECT_EQ(result.steps.survival.front(), 1.0);
  EXPECT_NEAR(result.steps.distribution.mean / result.steps.from_start.value, 1.0, 0.01);
  EXPECT_LT(result.steps.solver_disagreement, 1e-9);
  EXPECT_EQ(result.survivors.by_phase.size(), 8u);
  for (const PhaseDistribution& phase : result.survivors.by_phase)
    EXPECT_NEAR(std::accumulate(phase.mass.begin(), phase.mass.end(), 0.0), 1.0, 1e-9);
}

TEST(Metastability, RandomAndPlainDrawsGiveWiderIntervalsAroundTheSameAnswer) {
  const Problem problem = paper_setting(7.02, true).problem();
  StudyOptions options;
  options.cells = 128;
  options.samples = 16384;
  const Metastability best = study(problem, options);
  options.sequence = markov::Sequence::random;
  const Metastability random = study(problem, options);
  options.weighting = markov::Weighting::plain;
  const Metastability plain = study(problem, options);
  for (const Metastability* other : {&random, &plain}) {
    EXPECT_GT(other->steps.sampling_error, best.steps.sampling_error);
    EXPECT_LE(other->steps.from_start.lower, best.steps.from_start.upper);
    EXPECT_GE(other->steps.from_start.upper, best.steps.from_start.lower);
  }
}

// Each was once answered wrongly with a narrow interval, or not at all.
TEST(Metastability, FastLaunchesStayOnTheGridOnEveryLeg) {
  Setting plastic =
      paper_setting(7.02, false);  // rolls 15 steps, fast at first, on legs the first landing does not see
  plastic.law = dynamics::Law::plastic;
  plastic.slope_deg = 4.2;
  plastic.initial_speed = {5, 0.2};
  EXPECT_NEAR(study(plastic).steps.from_start.value, 15.0, 1e-5);  // slow launches of 3e-7 take 14
  Setting list = paper_setting(7.02, false);
  list.pairs = {{0.4, 0.4}, {0.3, 0.5}, {0.5, 0.2}, {0.45, 0.6}};
  const Metastability result = study(list);
  EXPECT_NEAR(result.steps.from_start.value, 2.66323, 4 * 0.0016);  // a million trials
}

// Restitution near one under little friction gains energy: survivors' speeds spread over decades, and equal cells over
// that range once gave 19.1 with a narrow interval. By 200,000 trials: 13.274 (s.e. 0.029).
TEST(Metastability, ContactsThatGainEnergySpreadTheCells) {
  Setting setting = paper_setting(9.59, false);
  setting.restitution = {0.7, 0.15};
  setting.friction = {0.3, 0.15};
  const Metastability result = study(setting);
  EXPECT_EQ(result.status, Status::converged);
  EXPECT_NEAR(result.steps.from_start.value, 13.274, 4 * 0.029);
}

TEST(Metastability, SettingsThatSoonRestAreAnswered) {
  const auto steps = [](dynamics::Law law, double slope_deg, Spread launch, Spread restitution, Spread friction) {
    Setting setting = paper_setting(7.02, true);
    setting.law = law;
    setting.slope_deg = slope_deg;
    setting.initial_speed = launch;
    setting.restitution = restitution;
    setting.friction = friction;
    return study(setting).steps.from_start.value;
  };
  using dynamics::Law;
  // Without noise the launch's distribution decides. By trials it is 3.852.
  EXPECT_NEAR(steps(Law::coulomb, 2, {4.5, 0.2}, {0.4, 0}, {0.4, 0}), 3.852, 0.01);
  // There is hardly any noise; by trials it is 3.274.
  EXPECT_NEAR(steps(Law::published, 6, {5, 0.2}, {0.4, 0.002}, {0.4, 0.002}), 3.274, 0.01);
  // These are too slow to survive even once, or nearly so.
  EXPECT_NEAR(steps(Law::published, 0.5, {3, 0.1}, {0.4, 0.1}, {0.4, 0.1}), 1.0, 1e-6);
  EXPECT_NEAR(steps(Law::published, 0.5, {5, 0.1}, {0.4, 0.1}, {0.4, 0.1}), 1.391, 0.01);
  EXPECT_DOUBLE_EQ(steps(Law::published, 7.02, {0, 0}, {0.4, 0.1}, {0.4, 0.1}), 1.0);
}

// These are uneven legs, from a launch of which all trials rest at once: survival once rose again after the first step.
TEST(Metastability, LaunchesTooSlowToVaultRestAtOnce) {
  Setting setting = paper_setting(9.59, false);
  setting.friction = {0.3, 0.05};
  const double regime = study(setting.problem(), {}).steps.from_quasi_stationary.value;
  setting.initial_speed = {1, 0.1};
  for (const Method method : {Method::sampled, Method::integrated}) {
    StudyOptions options;
    options.method = method;
    if (method == Method::integrated) setting.wheel.leg_length.assign(8, 0.1519);
    const Metastability result = study(setting.problem(), options);
    EXPECT_NEAR(result.steps.from_start.value, 1, 1e-12);
    EXPECT_EQ(result.steps.survival[0], 1);
    for (std::size_t n = 1; n < result.steps.survival.size(); ++n) EXPECT_LT(result.steps.survival[n], 1e-15);
    EXPECT_LT(*result.steps.reach_end, 1e-15);
    if (method == Method::sampled) {  // the launch has no say in it
      EXPECT_NEAR(result.steps.from_quasi_stationary.value / regime, 1, 0.02);
    }
  }
}

// Each once stretched the cells over the launch. A million trials give 6.4694 (s.e. 0.0034), 8.1936 (0.0043).
TEST(Metastability, FastLaunchesDoNotStretchTheCells) {
  Setting setting = paper_setting(7.02, false);
  const double regime = study(setting.problem(), {}).steps.from_quasi_stationary.value;
  const auto study_of = [&](Spread launch) {
    setting.initial_speed = launch;
    return study(setting.problem(), {});
  };
  for (const auto& [speed, trials] : {std::pair(50.0, 6.4694), std::pair(300.0, 8.1936)}) {
    const Metastability result = study_of({speed, 0.1});
    EXPECT_EQ(result.status, Status::converged);
    EXPECT_NEAR(result.steps.from_start.value / trials, 1, 0.004);
    EXPECT_NEAR(result.steps.from_quasi_stationary.value / regime, 1, 2e-4);
  }
  // The fastest that options take gives 9.194 (s.e. 0.035) by 20,000 trials.
  EXPECT_NEAR(study_of({1000, 0.1}).steps.from_start.value, 9.194, 0.1);
}

// A wheel a hundred times as long, launched as fast, is the same wheel launched ten times as fast.
TEST(Metastability, LengthsAndSpeedsScale) {
  Setting small = paper_setting(7.02, true), large = small;
  for (double& length : large.wheel.leg_length) length *= 100;
  large.wheel.ramp_stiffness /= 100;  // the contact lasts ten times as long, as everything does
  large.initial_speed = {7.35, 0.19};
  small.initial_speed = {73.5, 1.9};
  const Metastability a = study(small.problem(), {}), b = study(large.problem(), {});
  EXPECT_NEAR(a.steps.from_start.value / b.steps.from_start.value, 1, 1e-6);
  EXPECT_NEAR(a.survivors.mean / b.survivors.mean, 10, 1e-5);
}

TEST(Metastability, FailuresRarerThanTheDrawsReachDeepenTheTail) {
  // Rough terrain at a spread of 0.6 deg takes 1.4e31 steps, beyond tails of 1e-30.
  constexpr double degree = M_PI / 180;
  const auto rough = [&](double sd_deg) {
    const dynamics::RoughTerrainWheel wheel({.mean_slope_rad = 8 * degree, .sd_slope_rad = sd_deg * degree});
    const double start = wheel.fixed_point();
    return Problem{wheel, {[start](double) { return start; }, 0}, [](double x) { return std::sqrt(x); }, {}};
  };
  StudyOptions options;
  options.cells = 256;
  options.samples = 16384;
  const Metastability by_itself = study(rough(0.6), options);
  options.tail = 1e-120;
  const Metastability told = study(rough(0.6), options);
  EXPECT_GT(by_itself.steps.from_start.value, 1e31);
  EXPECT_LE(by_itself.steps.from_start.lower, told.steps.from_start.upper);
  EXPECT_GE(by_itself.steps.from_start.upper, told.steps.from_start.lower);
}

TEST(Metastability, PlainDrawsThatSeeNoRestSaySo) {
  Setting setting = paper_setting(7.02, true);
  setting.friction = {0.3, 0.02};
  StudyOptions options;
  options.weighting = markov::Weighting::plain;
  options.cells = 64;
  options.samples = 4096;
  const Metastability result = study(setting, options);
  EXPECT_EQ(result.status, Status::rest_unresolved);
  EXPECT_NE(result.message.find("plain"), std::string::npos);
}

TEST(Metastability, RestTooRareForDoublesIsSaid) {
  const Setting setting = equal_legs_under_coulomb(15, 0.43, {0.9, 0.035}, {0.14, 0.0165}, {2.6, 0.7});
  const Metastability result = study(setting, {.brief = true});
  EXPECT_EQ(result.status, Status::rest_unresolved);
  EXPECT_NE(result.message.find("exceed the range of double precision"), std::string::npos) << result.message;
}

// Nothing but a fast launch passes the widest cells, which must not pass for a regime: the same as after a slow one.
TEST(Metastability, RegimeDoesNotDependOnTheLaunch) {
  Setting setting = equal_legs_under_coulomb(2, 0.26, {0.4, 0.1}, {0.4, 0.1}, {8, 1});
  const Metastability slow = study(setting);
  setting.initial_speed = {80, 1};
  const Metastability fast = study(setting);
  EXPECT_NEAR(slow.steps.from_quasi_stationary.value, 1.12363, 5e-4);  // --method integrated
  EXPECT_NEAR(fast.steps.from_quasi_stationary.value, 1.12363, 1e-3);
  EXPECT_LT(fast.steps.from_quasi_stationary.upper - fast.steps.from_quasi_stationary.lower, 0.01);
  // Spectra sees eigenvalues there that are rounding. That is said, not shown.
  ASSERT_EQ(fast.spectrum.moduli.size(), 1u);
  EXPECT_NEAR(fast.spectrum.moduli.front(), 0.11003, 5e-4);
  EXPECT_NE(fast.message.find("eigenvalues beyond lambda_1: "), std::string::npos) << fast.message;
}

// Survivors who leave the usual speeds upwards come back: they must not pass for failures where these are rare.
TEST(Metastability, RareRestAfterAFastLaunch) {
  Setting setting = equal_legs_under_coulomb(2.18, 0.153, {0.74, 0.09}, {0.57, 0.057}, {15, 0.5});
  const StudyOptions options{.tolerance = 0.05, .threads = 1, .brief = true};
  const Metastability fast = study(setting, options);
  setting.initial_speed = {4, 0.5};
  const Metastability slow = study(setting, options);
  EXPECT_LT(fast.spectrum.failure_rate.value, 0.01);
  EXPECT_LT(std::abs(std::log(fast.spectrum.failure_rate.value / slow.spectrum.failure_rate.value)), 0.05);
}

TEST(Metastability, ToleranceThatCannotBeMetIsSaidAndTheResultKept) {
  StudyOptions options;
  options.tolerance = 1e-6;
  options.largest_cells = 128;
  options.largest_samples = 4096;
  const Metastability result = study(paper_setting(7.02, true), options);
  EXPECT_EQ(result.status, Status::tolerance_not_met);
  EXPECT_NE(result.message.find("not met"), std::string::npos);
  EXPECT_NEAR(result.steps.from_start.value, 4.26, 0.02);
}

TEST(Metastability, RefusesOptionsOutOfRange) {
  const Problem problem = paper_setting(7.02, true).problem();
  const auto expect_message = [&](const StudyOptions& options, const std::string& part) {
    EXPECT_NE(message_of([&] { study(problem, options); }).find(part), std::string::npos);
  };
  expect_message({.cells = 7}, "cells: 7 is outside 8..4096");
  expect_message({.samples = 3}, "samples: 3 is outside 16..");
  expect_message({.tolerance = 0}, "tolerance: 0 is outside (0, 1)");
  expect_message({.replicates = 1}, "replicates: 1 is outside 2..64");
}

// On two of the legs rest is 1e30 times rarer than on the others, and what they pay never settles by itself.
TEST(Metastability, LegsThatHardlyEverFailDoNotHoldTheOthersUp) {
  Setting setting;
  setting.slope_deg = 3.5;
  setting.law = dynamics::Law::coulomb;
  setting.initial_speed = {4, 0.3};
  const Metastability result = study(setting);
  // It is that of metastable steps --law coulomb --slope 3.5 --initial-speed 4,0.3 --method integrated.
  EXPECT_LE(result.steps.from_start.lower, 1.2837e5);
  EXPECT_GE(result.steps.from_start.upper, 1.2837e5);
}

}  // namespace
}  // namespace metastable::analysis
