#include "markov/mesh/coupled_passage.h"

#include <gtest/gtest.h>

#include "markov/mesh/other_gaits.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

const std::vector<double> start{-1};

TEST(CoupledPassage, IsWhatEliminationSaysOfItsChain) {
  for (const TwoGaits gaits : {TwoGaits{1.2, 0.13, 0.9}, TwoGaits{1, 0.12, 0.85}, TwoGaits{1, 0.3, 0.9}}) {
    const BatchMap map = gaits.batch();
    const std::vector<NoiseFrame> frames = noise_frames(map, start);
    MeshOptions options{.spacing = 0.4, .score_spacing = 0.8, .score_reach = 12};
    const OtherGaits others =
        find_other_gaits(map, frames, {frames.front().centre}, start, Mesh(map, frames, start, options), options);
    ASSERT_EQ(others.orbits.size(), 2u);
    options.sources = others.sources;
    options.start_action = others.start_action;
    options.limit = others.limit;
    const Mesh mesh(map, frames, start, options);
    const CoupledPassage coupled = passage_with_gaits(mesh, start, others.orbits, frames);
    const std::vector<double> mean = mean_first_passage(ChainSolver(mesh.chain()));
    const auto corners = mesh.corners(0, start);
    double steps = 0;
    for (int c = 0; c < corners.count; ++c)
      steps += corners.weight[static_cast<std::size_t>(c)] * mean[corners.node[static_cast<std::size_t>(c)]];
    const double bracket = coupled.passage.steps / coupled.passage.steps_lower - 1;  // of what leaves the mesh
    EXPECT_LT(bracket, 1e-3) << gaits.sd;
    EXPECT_NEAR(coupled.passage.steps_lower / steps, 1, 1e-6 + bracket) << gaits.sd;
    EXPECT_NEAR(coupled.share[0] + coupled.share[1], 1, 1e-6);
    const auto failures = failures_by_gait(mesh, start, coupled.passage.visits, others.orbits, frames);
    EXPECT_NEAR(failures[0] + failures[1], 1, 1e-6);
    EXPECT_GT(failures[0], 0.9) << gaits.sd;  // the other gait leads back there
    const double rate = quasi_stationary(ChainSolver(mesh.chain())).failure_rate;
    EXPECT_NEAR(coupled.passage.failure_rate / rate, 1, 1e-6 + 3 * bracket) << gaits.sd;
    EXPECT_GE(bracket, 0);
  }
}

// An orbit of two steps that the noise shifts against itself once in so many steps, from seldom to hardly ever.
TEST(CoupledPassage, TurnsOfOneGaitAreOne) {
  for (const double sd : {0.05, 0.02, 0.012}) {
    const BatchMap map = logistic_batch(3.2, sd, 0.85 + sd);
    const std::vector<double> middle{0.5130445095326298};  // on the orbit
    const auto walk = noise_free_walk(map, middle);
    ASSERT_TRUE(walk);
    const Mesh mesh(map, walk->frames, middle, {.spacing = 0.4, .score_spacing = 0.8});
    const GaitOrbit orbit{middle, {0.7994554904673701}};
    const CoupledPassage coupled = passage_with_gaits(mesh, middle, {orbit}, walk->frames);
    const ChainSolver solver(mesh.chain());
    const auto corners = mesh.corners(0, middle);
    const std::vector<double> mean = mean_first_passage(solver);
    double steps = 0;
    for (int c = 0; c < corners.count; ++c)
      steps += corners.weight[static_cast<std::size_t>(c)] * mean[corners.node[static_cast<std::size_t>(c)]];
    const double bracket = coupled.passage.steps / coupled.passage.steps_lower - 1;
    EXPECT_LT(bracket, 1e-3) << sd;
    EXPECT_NEAR(coupled.passage.steps_lower / steps, 1, 1e-6 + bracket) << sd;
    EXPECT_NEAR(coupled.passage.failure_rate / quasi_stationary(solver).failure_rate, 1, 1e-6 + 3 * bracket) << sd;
  }
}

TEST(OtherGaits, AreFoundOnlyWhereThereAreSome) {
  const std::vector<double> middle{2};
  const MeshOptions options{.spacing = 0.4, .score_spacing = 0.8};
  for (const double sd : {0.3, 1.2}) {
    const BatchMap map = linear_batch(sd);
    const auto frames = noise_frames(map, middle);
    const GaitOrbit own{frames.front().centre};
    EXPECT_EQ(find_other_gaits(map, frames, own, middle, Mesh(map, frames, middle, options), options).orbits.size(),
              1u);
  }
  const BatchMap trap = TwoGaits{3, 0.12, 0.85}.batch();
  const auto frames = noise_frames(trap, start);
  const OtherGaits found =
      find_other_gaits(trap, frames, {frames.front().centre}, start, Mesh(trap, frames, start, options), options);
  EXPECT_NE(found.trap.find("x1 = 2.99999"), std::string::npos) << found.trap;
}

}  // namespace
}  // namespace metastable::markov
