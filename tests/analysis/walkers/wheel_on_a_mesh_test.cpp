// The wheel with its eight uneven legs as phases of a mesh, against exact rows of its own chain.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "dynamics/return_map/wheel_map.h"
#include "markov/chain/solver.h"
#include "markov/mesh/mesh_study.h"
#include "markov/passage/first_passage.h"
#include "markov/rows/integrated.h"

namespace metastable::analysis {
namespace {

TEST(WheelOnAMesh, AgreesWithItsOwnChain) {
  // The paper's legs on 7.02 deg, eta ~ N(0.4, 0.1^2), mu ~ N(0.35, 0.1^2), from 5 rad/s.
  const dynamics::WheelMap wheel(dynamics::Wheel{}, 7.02 * std::numbers::pi / 180, dynamics::Law::published,
                                 dynamics::ContactNoise::normal(0.4, 0.1, 0.35, 0.1));
  const double first = 25;
  const markov::AnyReturnMap own(wheel);
  const markov::LaunchState launch{[first](double) { return first; }, 0};
  const markov::NodeSpace space(markov::node_ranges(own, launch, 1), 2);
  const markov::IntegratedChain rows = markov::integrate(own, space, launch);
  const std::vector<double> mean = markov::mean_first_passage(markov::ChainSolver(rows.chain.chain));
  const auto& after = rows.chain.launch.after;
  const double exact = 1 + std::inner_product(mean.begin(), mean.end(), after.begin(), 0.0);

  markov::BatchMap map;
  map.scores = wheel.noise_dimension();
  map.phases = wheel.phases();
  ASSERT_EQ(map.phases, 8);
  map.names = {"omega^2 [rad^2/s^2]"};
  map.step = [&wheel](int phase, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const auto landing = wheel.landing(states[i], phase, scores.subspan(2 * i, 2));
      failed[i] = !landing;
      next[i] = landing.value_or(0);
    }
  };
  map.inside = [](int, auto state) { return state[0] > 0; };
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
