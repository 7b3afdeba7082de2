// Holds the wheel with its eight uneven legs as phases of a mesh, against exact rows of its own chain.

#include <gtest/gtest.h>

#include <numeric>

#include "markov/chain/solver.h"
#include "markov/mesh/mesh_study.h"
#include "markov/passage/first_passage.h"
#include "markov/transition_rows/integrated.h"
#include "tests/analysis/walkers/wheel_batch.h"

namespace metastable::analysis {
namespace {

TEST(WheelOnAMesh, AgreesWithItsOwnChain) {
  const dynamics::WheelMap wheel = wheel_of_tests();  // from 5 rad/s
  const double first = 25;
  const markov::AnyReturnMap own(wheel);
  const markov::LaunchState launch{[first](double) { return first; }, 0};
  const markov::NodeSpace space(markov::node_ranges(own, launch, 1), 2);
  const markov::IntegratedChain rows = markov::integrate(own, space, launch);
  const std::vector<double> mean = markov::mean_first_passage(markov::ChainSolver(rows.chain.chain));
  const auto& after = rows.chain.launch.after;
  const double exact = 1 + std::inner_product(mean.begin(), mean.end(), after.begin(), 0.0);

  const markov::BatchMap map = wheel_batch(wheel);
  ASSERT_EQ(map.phases, 8);
  const std::vector<double> start{first};
  const markov::MeshStudy mesh =
      markov::mesh_study(map, start, {.spacing = 0.7, .margin = 8, .guided_samples = 0, .simulated_steps = 100000});
  EXPECT_EQ(mesh.disagreement, "");
  EXPECT_LE(mesh.steps.lower, exact);
  EXPECT_GE(mesh.steps.upper, exact);
  EXPECT_NEAR(mesh.steps.value / exact, 1, 0.05);
}

}  // namespace
}  // namespace metastable::analysis
