#include "markov/mesh/mesh_study.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "markov/mesh/batch_simulation.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"
#include "tests/markov/mesh/maps.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

// A map mean(x) + sd z on an interval, integrated by Gauss's four points on even panels.
struct Quadrature {
  double steps = 0;  // expected, from a state
  double rate = 0;   // of failing in a step, of those that have walked on for ever

  template <class Mean>
  Quadrature(Mean mean, double sd, double low, double high, double from, int panels) {
    const Eigen::Index nodes = 4 * panels;
    Eigen::ArrayXd at(nodes), weight(nodes);
    for (Eigen::Index k = 0; k < nodes; ++k) {
      constexpr std::array<double, 4> point{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                            0.8611363115940526};
      const double half = (high - low) / panels / 2, outer = 0.3478548451374538;
      at[k] = low + half * (2 * static_cast<double>(k / 4) + 1 + point[static_cast<std::size_t>(k % 4)]);
      weight[k] = half * (k % 4 == 0 || k % 4 == 3 ? outer : 1 - outer);
    }
    const auto mass = [&](double x, Eigen::Index to) {
      const double z = (at[to] - mean(x)) / sd;
      return std::exp(-0.5 * z * z) / (sd * std::sqrt(2 * std::numbers::pi)) * weight[to];
    };
    const auto tail = [](double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); };
    Eigen::MatrixXd left = Eigen::MatrixXd::Identity(nodes, nodes);
    Eigen::VectorXd first(nodes), kill(nodes);
    for (Eigen::Index i = 0; i < nodes; ++i) {
      for (Eigen::Index j = 0; j < nodes; ++j) left(i, j) -= mass(at[i], j);
      first[i] = mass(from, i);
      kill[i] = tail((high - mean(at[i])) / sd) + tail((mean(at[i]) - low) / sd);
    }
    const Eigen::PartialPivLU<Eigen::MatrixXd> solver(left.transpose());
    Eigen::VectorXd visits = solver.solve(first);
    steps = 1 + visits.sum();
    for (int k = 0; k < 20; ++k) visits = solver.solve(visits / visits.sum());
    rate = visits.dot(kill) / visits.sum();
  }
};

MeshStudyOptions quick() { return {.seed = 2, .guided_samples = 400, .simulated_steps = 100000}; }

TEST(MeshStudy, HoldsWhatQuadratureSays) {
  const std::vector<double> start{2};
  int inside = 0;
  for (const double sd : {1.2, 0.8, 0.6, 0.45, 0.35}) {  // 19 to 2.7e6 steps
    const double exact = linear_steps(sd, 2);
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
      const MeshStudy study =
          mesh_study(linear_batch(sd), start, {.seed = seed, .guided_samples = 0, .simulated_steps = 0});
      if (study.steps.lower <= exact && exact <= study.steps.upper) ++inside;
      EXPECT_NEAR(study.steps.value / exact, 1, 0.003) << sd << ' ' << seed;
      EXPECT_LT(study.steps.upper / study.steps.lower, 1.01) << sd << ' ' << seed;
    }
  }
  EXPECT_GE(inside, 18);  // of 20 intervals of 95 %
}

TEST(MeshStudy, MeshesCoarserThanTheDefaultSayHowLittleTheyKnow) {
  const std::vector<double> start{2};
  int inside = 0;
  for (const double sd : {1.2, 0.6, 0.35}) {
    const double exact = linear_steps(sd, 2);
    for (const double spacing : {1.2, 1.6, 2.0})
      for (const std::uint64_t seed : {1, 2, 3}) {
        const MeshStudy study = mesh_study(
            linear_batch(sd), start, {.spacing = spacing, .seed = seed, .guided_samples = 0, .simulated_steps = 0});
        if (study.steps.lower <= exact && exact <= study.steps.upper) ++inside;
      }
  }
  EXPECT_GE(inside, 25);  // of 27 intervals of 95 %
}

TEST(MeshStudy, TwoDimensionsOfWhichOneMatters) {
  const std::vector<double> start{2, -2.0 / 3};
  const double exact = linear_steps(1.0, 2);
  const MeshStudy study = mesh_study(skew_batch(1.0), start,
                                     {.spacing = 0.8, .margin = 14, .guided_samples = 0, .simulated_steps = 100000});
  EXPECT_NEAR(study.steps.value / exact, 1, 0.005);
  EXPECT_LE(study.steps.lower, exact);
  EXPECT_GE(study.steps.upper, exact);
}

TEST(MeshStudy, PhasesAgreeWithSimulation) {
  const std::vector<double> start{2};
  const BatchMap map = two_phase_batch(0.8);
  const MeshStudy study = mesh_study(map, start, quick());
  const auto simulated = simulate_steps(map, start, {.trials = 20000, .seed = 2});
  ASSERT_TRUE(simulated);
  EXPECT_NEAR(study.steps.value, simulated->mean, 4 * simulated->standard_error);
  EXPECT_EQ(study.disagreement, "");
}

TEST(MeshStudy, SharesThatWalkOnAreThoseOfSimulationAndAddUpToTheSteps) {
  const std::vector<double> start{2};
  for (const BatchMap& map : {linear_batch(1.2), two_phase_batch(1.2), cubic_batch(0.4)}) {
    const MeshStudy study = mesh_study(map, start, {.guided_samples = 0, .simulated_steps = 0});
    double sum = 0;
    for (std::uint64_t n = 0; n < 5000; ++n) sum += survival_after(study, n).value;
    EXPECT_NEAR(sum / study.steps.value, 1, 2e-3);
    const std::uint64_t longest = 60;
    const std::vector<std::uint64_t> walks = follow_walks(map, start, longest, {.trials = 100000, .seed = 3});
    for (const std::uint64_t n : {1U, 2U, 5U, 20U, 60U}) {
      const auto on = std::ranges::count_if(walks, [n](std::uint64_t failed) { return failed == 0 || failed > n; });
      const double share = static_cast<double>(on) / static_cast<double>(walks.size());
      const MeshEstimate told = survival_after(study, n);
      EXPECT_NEAR(told.value, share, 4 * std::sqrt(share * (1 - share) / 1e5) + (told.upper - told.lower)) << n;
      EXPECT_LT(told.upper - told.lower, 0.02) << n;
    }
  }
}

// The start is an unstable orbit, beside which the map walks on with period two; simulation knows the same.
TEST(MeshStudy, FollowsGaitsThatComeBackAfterTwoSteps) {
  for (const double sd : {0.4, 0.3, 0.25}) {  // 228 to 2.1e4 steps
    const MeshStudy study = mesh_study(cubic_batch(sd), std::vector<double>{0}, quick());
    const double exact = Quadrature(cubic, sd, -2, 2, 0, 50).steps;
    EXPECT_EQ(study.period, 2);
    EXPECT_EQ(study.disagreement, "");
    EXPECT_NEAR(std::abs(study.orbit.frames[0].centre[0]), 1, 1e-9);
    EXPECT_NEAR(study.steps.value / exact, 1, 0.003) << sd;
    EXPECT_LE(study.steps.lower, exact * 1.0005) << sd;
    EXPECT_GE(study.steps.upper, exact * 0.9995) << sd;
    EXPECT_EQ(study.simulated.has_value(), sd == 0.4);  // by 100,000 steps
  }
}

// The noise shifts these orbits of two, four and eight steps against themselves, often or hardly ever: each is one
// gait. At r = 3.8 and 4.1 there is none, and without noise the latter fails.
TEST(MeshStudy, HoldsOrbitsThatTheNoiseShiftsAndWalksWithoutAny) {
  struct Case {
    double r, sd, high, start;
    int period, panels;
  };
  for (const Case& c : {Case{3.2, 0.08, 1, 0.5, 2, 40},
                        {3.5, 0.08, 1, 0.5, 4, 40},
                        {3.5, 0.04, 1, 0.5, 4, 60},
                        {3.55, 0.04, 1, 0.5, 8, 60},
                        {3.2, 0.012, 0.85, 0.5, 2, 120},
                        {3.8, 0.02, 1, 0.5, 0, 80},
                        {4.1, 0.01, 1, 0.3, 0, 120}}) {
    const std::vector<double> start{c.start};
    const MeshStudy study = mesh_study(logistic_batch(c.r, c.sd, c.high), start, quick());
    const Quadrature exact([&](double x) { return c.r * x * (1 - x); }, c.sd, 0, c.high, c.start, c.panels);
    EXPECT_EQ(study.disagreement, "") << c.r;
    EXPECT_EQ(study.period, c.period);
    EXPECT_EQ(study.fails_without_noise > 0, c.r > 4);
    EXPECT_EQ(study.gaits.orbits.size(), 1u);
    EXPECT_NEAR(study.steps.value / exact.steps, 1, 0.003) << c.r << ' ' << c.sd;
    EXPECT_NEAR(study.failure_rate.value / exact.rate, 1, 0.004) << c.r << ' ' << c.sd;
    EXPECT_LE(study.steps.lower, exact.steps * 1.001) << c.r << ' ' << c.sd;
    EXPECT_GE(study.steps.upper, exact.steps * 0.999) << c.r << ' ' << c.sd;
    EXPECT_LT(study.steps.upper / study.steps.lower, 1.02) << c.r << ' ' << c.sd;
  }
}

// Nodes of one mesh number 16384 spacings to either side; turns further apart have meshes of their own.
TEST(MeshStudy, TurnsFarApartHaveMeshesOfTheirOwn) {
  BatchMap map;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const double side = states[i] > 0 ? 1000 : -1000;
      next[i] = -side + 0.5 * (states[i] - side) + 0.01 * scores[i];
      failed[i] = std::abs(std::abs(next[i]) - 1000) > 0.04;
    }
  };
  const MeshStudy study = mesh_study(map, std::vector<double>{1000}, quick());
  EXPECT_EQ(study.period, 2);
  EXPECT_EQ(study.frames.size(), 2U);
  const Quadrature exact([](double x) { return 0.5 * x; }, 0.01, -0.04, 0.04, 0, 30);
  EXPECT_NEAR(study.steps.value / exact.steps, 1, 0.003);
}

// It fails beyond -1.9 and 2.3; a simulated failure is of the gait that its walk was within one sd of last.
TEST(MeshStudy, SaysFromWhichGaitFailuresCome) {
  const auto mean = [](double x) { return x * (1.5 - 0.5 * x * x) + 0.05; };
  BatchMap map;
  map.step = [mean](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = mean(states[i]) + 0.35 * scores[i];
      failed[i] = !(next[i] > -1.9 && next[i] < 2.3);
    }
  };
  const MeshStudy study = mesh_study(map, std::vector<double>{-1}, quick());
  ASSERT_EQ(study.gait_failures.size(), 2u);
  const NoiseFrame& frame = study.frames.front();
  const double low = study.gaits.orbits[0][0][0], high = study.gaits.orbits[1][0][0];
  std::size_t steps = 0, above = 0, failures = 0, failures_above = 0;
  for (; failures < 3000; ++failures) {
    double x = -1;
    bool last = false;
    for (std::uint64_t n = 0; x > -1.9 && x < 2.3; ++n, ++steps) {
      if (std::abs(x - (last ? low : high)) < frame.axes[0]) last = !last;
      above += last;
      x = mean(x) + 0.35 * normal_score(uniforms(9, 0, failures, n)[0]);
    }
    failures_above += last;
  }
  const auto share = [](std::size_t some, std::size_t all) {
    return static_cast<double>(some) / static_cast<double>(all);
  };
  EXPECT_NEAR(study.steps.value, share(steps, failures), 0.08 * study.steps.value);
  EXPECT_NEAR(study.gait_share[1], share(above, steps), 0.05);
  EXPECT_NEAR(study.gait_failures[1], share(failures_above, failures), 0.035);
  EXPECT_GT(std::abs(study.gait_failures[1] - study.gait_share[1]), 0.1);
}

// Two gaits lie at 1 and -1 beside an unstable start, 0: x' = 3/2 x - x^3 / 2, failed beyond -2 and 2.
TEST(MeshStudy, FollowsGaitsBesideAnUnstableStart) {
  BatchMap map;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] * (1.5 - 0.5 * states[i] * states[i]) + 0.35 * scores[i];
      failed[i] = std::abs(next[i]) > 2;
    }
  };
  const std::vector<double> start{0};
  const MeshStudy study = mesh_study(map, start, quick());
  const auto simulated = simulate_steps(map, start, {.trials = 4000, .seed = 5});
  ASSERT_TRUE(simulated);
  EXPECT_EQ(study.period, 1);
  EXPECT_EQ(study.gaits.orbits.size(), 2U);
  EXPECT_NEAR(study.steps.value, simulated->mean, 4 * simulated->standard_error);
}

// Logistic maps x' = r x (1 - x) have stable cycles of 2 at r = 3.2, of 4 at 3.5, of 3 at 3.83 and none at 3.9.
TEST(PeriodicGait, FindsThePeriodsOfLogisticMaps) {
  const auto logistic = [](double r) {
    BatchMap map;
    map.step = [r](int, auto states, auto scores, auto next, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) next[i] = r * states[i] * (1 - states[i]) + 1e-3 * scores[i];
    };
    return map;
  };
  for (const auto& [r, period] : {std::pair{2.5, 1}, {3.2, 2}, {3.44, 2}, {3.445, 2}, {3.5, 4}, {3.83, 3}, {3.9, 0}}) {
    const auto gait = periodic_gait(logistic(r), std::vector<double>{1 - 1 / r});
    EXPECT_EQ(gait ? gait->period : 0, period) << r;
  }
  // The map with r = 4 leaves the unit interval from right above 1, and the finite numbers after that.
  EXPECT_FALSE(periodic_gait(logistic(4), std::vector<double>{1}));
  // 32 revolutions from 3.56876 on, 64 from 3.56969 on, none at 3.6 (Feigenbaum's sequence); 4 at 3.5 is not longer.
  for (const auto& [r, period] : {std::pair(3.569, 32), std::pair(3.5697, 64), std::pair(3.6, 0), std::pair(3.5, 0)})
    EXPECT_EQ(longer_period(logistic(r), std::vector<double>{1 - 1 / r}), period) << r;
}

TEST(MeshStudy, SaysWhereTheWaysDisagree) {
  // This map shows meshes less noise than it shows simulations, which come after them.
  std::size_t calls = 0, of_meshes = SIZE_MAX;
  BatchMap map = linear_batch(0.8);
  map.step = [&](int, auto states, auto scores, auto next, auto failed) {
    const double sd = ++calls > of_meshes ? 0.9 : 0.8;
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + sd * scores[i];
      failed[i] = next[i] <= 0;
    }
  };
  const std::vector<double> start{2};
  MeshStudyOptions options{.threads = 1, .guided_samples = 0, .simulated_steps = 0};
  EXPECT_EQ(mesh_study(map, start, options).disagreement, "");
  of_meshes = std::exchange(calls, 0);
  options.simulated_steps = 1000000;
  const MeshStudy study = mesh_study(map, start, options);
  EXPECT_GT(calls, of_meshes);
  EXPECT_NE(study.disagreement.find("direct simulation"), std::string::npos) << study.disagreement;
}

TEST(MeshStudy, SimulationRefutesFailuresThatAreSteppedOver) {
  const std::vector<double> start{0};
  const auto said = [&](const BatchMap& map) { return mesh_study(map, start, quick()).disagreement; };
  // 11.8, 645 and 2196 steps by simulation, where meshes alone say 4.9e6 and more.
  const std::string wide = said(damped_batch([](double, double z, double) { return z > 0.9 && z < 1.3; })),
                    narrow = said(damped_batch([](double, double z, double) { return z > 2 && z < 2.03; })),
                    hole = said(damped_batch([](double, double, double x) { return std::abs(x - 1) < 0.001; }));
  for (const std::string& text : {wide, narrow, hole}) {
    EXPECT_NE(text.find("of 512 simulated walks fail"), std::string::npos) << text;
    EXPECT_NE(text.find("disagree"), std::string::npos) << text;
  }
  EXPECT_NE(narrow.find("failed within 97 steps, where the mesh foretells 0.0"), std::string::npos) << narrow;
  // The sentence gives the mean of the simulated trials where enough of them fail: 11.8 and 645 steps.
  EXPECT_NE(wide.find("simulated trials fail after 11."), std::string::npos) << wide;
  EXPECT_NE(narrow.find("simulated trials fail after "), std::string::npos) << narrow;
  const BatchMap by_state = damped_batch([](double s, double, double) { return s > 1.9 && s < 1.95; });
  try {  // its nodes may or may not meet the band
    EXPECT_NE(mesh_study(by_state, start, quick()).disagreement, "");
  } catch (const Disagreement& error) {
    EXPECT_NE(std::string(error.what()).find("512 simulated walks"), std::string::npos) << error.what();
  }
}

TEST(MeshStudy, RandomStepsRefuteBandsThatSimulationCannotSee) {
  const std::vector<double> start{0};
  for (const BatchMap& map : {damped_batch([](double, double z, double) { return z > 4.75 && z < 4.8; }),
                              damped_batch([](double s, double, double) { return s > 4 && s < 4.05; })}) {
    const MeshStudy study = mesh_study(map, start, quick());
    EXPECT_NE(study.disagreement, "") << study.steps.value;
  }
  const MeshStudy smooth = mesh_study(damped_batch([](double, double, double) { return false; }), start, quick());
  EXPECT_EQ(smooth.disagreement, "");
  EXPECT_EQ(smooth.blind_spots.hits, 0u);
}

TEST(MeshStudy, FollowsSlipsToAnotherGaitHoweverRare) {
  const std::vector<double> start{-1};
  for (const TwoGaits gaits : {TwoGaits{1.2, 0.13, 0.9}, TwoGaits{1, 0.12, 0.85}}) {
    const double exact = gaits.steps();  // 5.0e19, 4.07e12
    const MeshStudy study = mesh_study(gaits.batch(), start, quick());
    EXPECT_EQ(study.disagreement, "");
    EXPECT_LE(study.steps.lower, exact);
    EXPECT_GE(study.steps.upper, exact);
    EXPECT_NEAR(study.steps.value / exact, 1, 0.01);
    EXPECT_LT(study.steps.upper / study.steps.lower, 1.05);
    EXPECT_EQ(study.gaits.orbits.size(), 2u);
    EXPECT_FALSE(study.simulated || study.guided);  // they would start in one gait
  }
}

TEST(MeshStudy, GivesNoNumberWhereAGaitIsATrap) {
  const std::vector<double> start{-1};
  EXPECT_THROW(mesh_study(TwoGaits{3, 0.12, 0.85}.batch(), start, quick()), Disagreement);
}

// Each trial takes memory, so that their number has an end where the steps allowed have none.
TEST(MeshStudy, SimulatesTenMillionTrialsAtMost) {
  const std::vector<double> start{2};
  const MeshStudy study = mesh_study(linear_batch(8), start, {.guided_samples = 0, .simulated_steps = 1000000000000});
  EXPECT_EQ(study.simulated_trials, 10000000U);
  EXPECT_TRUE(study.disagreement.empty()) << study.disagreement;
}

TEST(MeshStudy, SaysOnlyWhatWasFound) {
  const std::vector<double> start{0};
  const auto text = [&](const BatchMap& map) {
    return message_of<std::exception>([&] { mesh_study(map, start, quick()); });
  };
  const std::string at_once = text(damped_batch([](double, double, double) { return true; }));
  EXPECT_NE(at_once.find("even without noise it fails"), std::string::npos) << at_once;
  EXPECT_NE(at_once.find("512 of 512 simulated walks fail, after 1 steps in the mean"), std::string::npos) << at_once;
  const std::string beside = text(damped_batch([](double, double z, double) { return z > 0.005 && z < 0.5; }));
  EXPECT_NE(beside.find("a noise of 0.01 sd makes it fail"), std::string::npos) << beside;
  EXPECT_EQ(beside.find("even without noise"), std::string::npos) << beside;
  MeshStudyOptions none = quick();
  none.guided_samples = none.simulated_steps = 0;
  const MeshStudy study = mesh_study(linear_batch(0.6), std::vector<double>{2}, none);
  EXPECT_EQ(study.no_simulated, "not asked for");
  EXPECT_EQ(study.no_guided, "not asked for");
}

TEST(MeshStudy, SameSeedSameBitsOnAnyNumberOfThreads) {
  const std::vector<double> start{2};
  MeshStudyOptions options = quick();
  options.threads = 1;
  const MeshStudy one = mesh_study(linear_batch(0.6), start, options);
  options.threads = 3;
  const MeshStudy three = mesh_study(linear_batch(0.6), start, options);
  EXPECT_EQ(one.steps.value, three.steps.value);
  EXPECT_EQ(one.steps.upper, three.steps.upper);
  EXPECT_EQ(one.guided->value, three.guided->value);
}

// Far states are left out of the mesh, and nearly all that are there come back: 10170 steps by Gauss's points in
// asinh(x / 0.3), 1200 and 2000 of them. What a mesh leaves out is no failure, and guided samples do not take it for
// one.
TEST(MeshStudy, WhatLeavesTheMeshIsNoFailure) {
  BatchMap map;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 0.3 * std::sinh(1.5 * scores[i]);
      failed[i] = next[i] >= 40;
    }
  };
  const MeshStudy study = mesh_study(map, std::vector<double>{0}, {.seed = 1, .simulated_steps = 100000});
  EXPECT_EQ(study.disagreement, "");
  EXPECT_NEAR(study.steps.value / 10170, 1, 0.005);
  EXPECT_LT(study.steps.lower, 10170);
  EXPECT_GT(study.steps.upper, 10170);
  ASSERT_TRUE(study.guided);
  EXPECT_NEAR(study.guided->value / 10170, 1, 0.03);
}

TEST(MeshStudy, HasAsManyShiftsAsTheyScatter) {
  const std::vector<double> start{2};
  std::size_t fewest = 6;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    const MeshStudy study =
        mesh_study(linear_batch(0.8), start, {.seed = seed, .guided_samples = 0, .simulated_steps = 0});
    const std::size_t shifts = study.sizes.front().steps.size();
    for (const MeshSize& size : study.sizes) EXPECT_EQ(size.steps.size(), shifts);
    EXPECT_GE(shifts, 3u);
    if (shifts < 6) {
      EXPECT_LE(study.shift_error, study.discretization_error + study.bracket);
    }
    fewest = std::min(fewest, shifts);
  }
  EXPECT_LT(fewest, 6u);
}

TEST(MeshStudy, NamesOptionsOutOfRange) {
  const std::vector<double> start{2};
  EXPECT_THROW(mesh_study(linear_batch(0.6), start, {.sizes = 2}), std::invalid_argument);
  EXPECT_THROW(mesh_study(linear_batch(0.6), start, {.shifts = 5}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
