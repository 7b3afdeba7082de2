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
    const OtherGaits others = find_other_gaits(map, frames, start, Mesh(map, frames, start, options), options);
    ASSERT_EQ(others.states.size(), 2u);
    options.sources = others.sources;
    options.start_action = others.start_action;
    options.limit = others.limit;
    const Mesh mesh(map, frames, start, options);
    const CoupledPassage coupled = coupled_passage(mesh, start, gait_classes(mesh, others.states, frames), 2);
    const std::vector<double> mean = mean_first_passage(ChainSolver(mesh.chain()));
    const auto corners = mesh.corners(0, start);
    double steps = 0;
    for (int c = 0; c < corners.count; ++c)
      steps += corners.weight[static_cast<std::size_t>(c)] * mean[corners.node[static_cast<std::size_t>(c)]];
    const double bracket = coupled.passage.steps_upper / coupled.passage.steps_lower - 1;  // of what leaves the mesh
    EXPECT_LT(bracket, 1e-3) << gaits.sd;
    EXPECT_NEAR(coupled.passage.steps_lower / steps, 1, 1e-6 + bracket) << gaits.sd;
    EXPECT_NEAR(coupled.share[0] + coupled.share[1], 1, 1e-6);
    const double rate = quasi_stationary(ChainSolver(mesh.chain())).failure_rate;
    EXPECT_NEAR(coupled.passage.failure_rate / rate, 1, 1e-6 + 3 * bracket) << gaits.sd;
    EXPECT_GE(bracket, 0);
  }
}

TEST(OtherGaits, AreFoundOnlyWhereThereAreSome) {
  const std::vector<double> middle{2};
  const MeshOptions options{.spacing = 0.4, .score_spacing = 0.8};
  for (const double sd : {0.3, 1.2}) {
    const BatchMap map = linear_batch(sd);
    const auto frames = noise_frames(map, middle);
    EXPECT_EQ(find_other_gaits(map, frames, middle, Mesh(map, frames, middle, options), options).states.size(), 1u);
  }
  const BatchMap trap = TwoGaits{3, 0.12, 0.85}.batch();
  const auto frames = noise_frames(trap, start);
  const OtherGaits found = find_other_gaits(trap, frames, start, Mesh(trap, frames, start, options), options);
  EXPECT_NE(found.trap.find("x1 = 2.99999"), std::string::npos) << found.trap;
}

}  // namespace
}  // namespace metastable::markov
