#include "markov/mesh/mesh_study.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "markov/mesh/batch_simulation.h"
#include "tests/markov/mesh/maps.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

// Returns the expected steps of the cubic map from x, by the midpoint rule on `nodes` of [-2, 2].
double cubic_steps(double sd, double x, int nodes) {
  const double width = 4.0 / nodes;
  const auto density = [&](double from, double to) {
    const double z = (to - cubic(from)) / sd;
    return std::exp(-0.5 * z * z) / (sd * std::sqrt(2 * std::numbers::pi)) * width;
  };
  const Eigen::ArrayXd at = Eigen::ArrayXd::LinSpaced(nodes, -2 + width / 2, 2 - width / 2);
  Eigen::MatrixXd left = Eigen::MatrixXd::Identity(nodes, nodes);
  for (Eigen::Index i = 0; i < nodes; ++i)
    for (Eigen::Index j = 0; j < nodes; ++j) left(i, j) -= density(at[i], at[j]);
  const Eigen::VectorXd steps = left.partialPivLu().solve(Eigen::VectorXd::Ones(nodes));
  double mean = 1;
  for (Eigen::Index j = 0; j < nodes; ++j) mean += density(x, at[j]) * steps[j];
  return mean;
}

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

// The start is an unstable orbit, beside which the map walks on with period two; simulation knows the same.
TEST(MeshStudy, FollowsGaitsThatComeBackAfterTwoSteps) {
  for (const double sd : {0.4, 0.3, 0.25}) {  // 228 to 2.1e4 steps
    const MeshStudy study = mesh_study(cubic_batch(sd), std::vector<double>{0}, quick());
    const double exact = cubic_steps(sd, 0, 400);
    EXPECT_EQ(study.period, 2);
    EXPECT_EQ(study.disagreement, "");
    EXPECT_NEAR(std::abs(study.orbit.frames[0].centre[0]), 1, 1e-9);
    EXPECT_NEAR(study.steps.value / exact, 1, 0.003) << sd;
    EXPECT_LE(study.steps.lower, exact * 1.0005) << sd;
    EXPECT_GE(study.steps.upper, exact * 0.9995) << sd;
    EXPECT_EQ(study.simulated.has_value(), sd == 0.4);  // by 100,000 steps
  }
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
  EXPECT_EQ(study.gaits.states.size(), 2U);
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
  EXPECT_NE(study.disagreement.find("no number is given"), std::string::npos);
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
    EXPECT_NE(text.find("no number is given"), std::string::npos) << text;
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
    EXPECT_LE(study.steps.lower, 1.003 * exact);
    EXPECT_GE(study.steps.upper, 0.997 * exact);
    EXPECT_LT(study.steps.upper / study.steps.lower, 1.05);
    EXPECT_EQ(study.gaits.states.size(), 2u);
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

TEST(MeshStudy, NamesOptionsOutOfRange) {
  const std::vector<double> start{2};
  EXPECT_THROW(mesh_study(linear_batch(0.6), start, {.sizes = 2}), std::invalid_argument);
  EXPECT_THROW(mesh_study(linear_batch(0.6), start, {.shifts = 5}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
