#include "markov/mesh/mesh_study.h"

#include <gtest/gtest.h>

#include "markov/mesh/batch_simulation.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

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

TEST(MeshStudy, SaysWhereTheWaysDisagree) {
  // This map shows meshes less noise than it shows simulations.
  bool simulating = false;
  BatchMap map = linear_batch(0.8);
  map.step = [&](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + (simulating ? 0.9 : 0.8) * scores[i];
      failed[i] = next[i] <= 0;
    }
  };
  const std::vector<double> start{2};
  MeshStudyOptions options{.threads = 1, .guided_samples = 0, .simulated_steps = 1000000};
  options.progress = [&](double share) { simulating = share > 0.79; };  // meshes are four fifths of the work
  const MeshStudy study = mesh_study(map, start, options);
  EXPECT_NE(study.disagreement.find("direct simulation"), std::string::npos);
  EXPECT_NE(study.disagreement.find("no number is given"), std::string::npos);
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
