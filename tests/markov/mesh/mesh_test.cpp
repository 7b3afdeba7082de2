#include "markov/mesh/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "markov/chain/eigenpairs.h"
#include "markov/mesh/guided_sampling.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

const std::vector<double> middle{2};

Mesh linear_mesh(double sd, double spacing, std::uint32_t shift = 0) {
  const BatchMap map = linear_batch(sd);
  return {map, noise_frames(map, middle), middle, {.spacing = spacing, .shift = shift, .score_spacing = 0.3}};
}

TEST(NoiseFrame, IsTheStationaryCovariance) {
  // Variances are, of x, sd^2 / (1 - 1/4); of y, 1 / (1 - 0.36); the state is (x + y, y - x / 3).
  const BatchMap map = skew_batch(0.3);
  const std::vector<double> start{2.1, -0.6};
  const NoiseFrame frame = noise_frames(map, start).front();
  EXPECT_NEAR(frame.centre[0], 2, 1e-9);
  EXPECT_NEAR(frame.centre[1], -2.0 / 3, 1e-9);
  const double x = 0.09 / 0.75, y = 1 / 0.64;
  const auto covariance = [&](std::size_t i, std::size_t j) {
    return frame.axes[2 * i] * frame.axes[2 * j] + frame.axes[2 * i + 1] * frame.axes[2 * j + 1];
  };
  EXPECT_NEAR(covariance(0, 0), x + y, 1e-6);
  EXPECT_NEAR(covariance(1, 1), y + x / 9, 1e-6);
  EXPECT_NEAR(covariance(0, 1), y - x / 3, 1e-6);
}

TEST(Mesh, RowsAreProbabilitiesWithTheLandingsMean) {
  const BatchMap map = skew_batch(0.5);
  const std::vector<double> start{2, -2.0 / 3};
  const Mesh mesh(map, noise_frames(map, start), start, {.spacing = 0.8});
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto values = mesh.values(i);
    for (const double value : values) EXPECT_GT(value, 0);
    EXPECT_NEAR(std::accumulate(values.begin(), values.end(), mesh.kill()[i] + mesh.leave()[i]), 1, 1e-12);
    if (mesh.kill()[i] + mesh.leave()[i] > 1e-8) continue;
    const std::vector<double> from = mesh.state(i);
    double mean = 0;
    for (std::size_t e = 0; e < values.size(); ++e) mean += values[e] * mesh.state(mesh.columns(i)[e])[0];
    const double x = 0.75 * (from[0] - from[1]);
    EXPECT_NEAR(mean, x / 2 + 1 + 0.6 * (from[0] - x), 1e-6);
  }
}

TEST(Mesh, PassageIsWhatEliminationSaysOfItsChain) {
  for (const double sd : {1.0, 0.45, 0.3}) {  // 1e1 to 4e8 steps
    const Mesh mesh = linear_mesh(sd, 0.3);
    const MeshPassage passage = mesh_passage(mesh, middle, 1e-9);
    const ChainSolver solver(mesh.chain());
    const std::vector<double> mean = mean_first_passage(solver);
    const auto corners = mesh.corners(0, middle);
    double steps = 0;
    for (int c = 0; c < corners.count; ++c)
      steps += corners.weight[static_cast<std::size_t>(c)] * mean[corners.node[static_cast<std::size_t>(c)]];
    EXPECT_NEAR(passage.steps_lower / steps, 1, 1e-8) << sd;
    EXPECT_NEAR(passage.failure_rate / quasi_stationary(solver).failure_rate, 1, 1e-3) << sd;  // up to what leaves
    EXPECT_GE(passage.steps, passage.steps_lower);
  }
}

TEST(Mesh, MixesAsItsSecondEigenvalueSays) {
  const Mesh mesh = linear_mesh(0.6, 0.3);
  const auto values = leading_eigenpairs(mesh.chain(), 2).values;
  EXPECT_NEAR(mesh_passage(mesh, middle).mixing_steps, 1 / std::log(std::abs(values[0]) / std::abs(values[1])), 0.05);
}

TEST(Mesh, ErrorFallsWithTheSquareOfTheSpacingAndIsLow) {
  const double exact = std::log(linear_steps(0.5, 2));
  std::vector<double> error;
  for (const double spacing : {0.4, 0.2}) {
    double sum = 0;
    for (std::uint32_t shift = 0; shift < 6; ++shift)
      sum += std::log(mesh_passage(linear_mesh(0.5, spacing, shift), middle).steps) / 6;
    error.push_back(sum - exact);
  }
  EXPECT_LT(error[0], 0);
  EXPECT_NEAR(error[0] / error[1], 4, 1);
}

TEST(Mesh, SurvivalBelongsToTheSteps) {
  const MeshPassage passage = mesh_passage(linear_mesh(1.0, 0.3), middle);
  double steps = 1;  // sum of survival beyond 0, 1, 2, ... steps
  for (const double share : passage.survival) steps += share;
  const double last = passage.survival.back();
  steps += last * (1 - passage.failure_rate) / passage.failure_rate;
  EXPECT_NEAR(steps / passage.steps, 1, 1e-6);
}

TEST(Mesh, RefusesWhatItCannotHold) {
  const BatchMap map = linear_batch(0.3);
  const auto frames = noise_frames(map, middle);
  EXPECT_THROW(Mesh(map, frames, middle, {.spacing = 0.05, .most_bytes = 1000}), std::length_error);
  EXPECT_THROW(Mesh(map, frames, middle, {.spacing = 0}), std::invalid_argument);
  EXPECT_THROW(Mesh(map, frames, middle, {.spacing = 0.5, .score_spacing = 0}), std::invalid_argument);
  EXPECT_THROW(Mesh(map, frames, middle, {.spacing = 0.5, .score_reach = 0}), std::invalid_argument);
}

TEST(GuidedSampling, IsRightHoweverCoarseItsMesh) {
  const BatchMap map = linear_batch(0.4);
  const double exact = linear_steps(0.4, 2);  // 1e5 steps
  for (const double spacing : {0.4, 1.0}) {
    const GuidedRate guided =
        guided_failure_rate(map, linear_mesh(0.4, spacing), middle, {.samples = 1500, .burn_in = 30, .window = 8});
    EXPECT_LT(guided.standard_error, 0.05 * guided.rate);
    EXPECT_NEAR(guided.rate * exact, 1, 4 * guided.standard_error / guided.rate) << spacing;
  }
}

// From most states of survivors failures are far: a step or two lead to none.
TEST(GuidedSampling, WindowThatTheMeshForetellsHasEvenWeights) {
  const BatchMap map = linear_batch(0.4);
  const Mesh mesh = linear_mesh(0.4, 0.4);
  const MeshPassage passage = mesh_passage(mesh, middle);
  const int window = reaching_window(mesh, passage.distribution, 30);
  EXPECT_GT(window, 2);
  EXPECT_LT(window, 20);
  EXPECT_EQ(reaching_window(mesh, passage.distribution, window - 1), window - 1);
  EXPECT_EQ(reaching_window(mesh, {}, 30), 30);
  const GuidedRate guided = guided_failure_rate(map, mesh, middle, {.samples = 1500, .burn_in = 30, .window = window});
  EXPECT_GT(guided.effective_samples, 0.5 * 1500);
  EXPECT_NEAR(guided.rate * linear_steps(0.4, 2), 1, 4 * guided.standard_error / guided.rate);
}

TEST(GuidedSampling, TakesTurnsAtThePhases) {
  const BatchMap map = two_phase_batch(0.45);
  const Mesh mesh(map, noise_frames(map, middle), middle, {.spacing = 0.1, .score_spacing = 0.3});
  const GuidedRate guided = guided_failure_rate(map, mesh, middle, {.samples = 1500, .burn_in = 40, .window = 8});
  EXPECT_NEAR(guided.rate / mesh_passage(mesh, middle).failure_rate, 1, 0.15);
}

}  // namespace
}  // namespace metastable::markov
