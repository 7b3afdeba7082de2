#include "markov/mesh/batch_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "markov/mesh/batch_simulation.h"
#include "markov/mesh/guided_sampling.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/mesh_study.h"
#include "tests/markov/mesh/maps.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using testing::linear_batch;
using testing::linear_steps;

TEST(BatchMap, NamesTheStateThatLeadsToNoNumber) {
  BatchMap map = linear_batch(0.3);
  const auto step = map.step;
  map.step = [step](int phase, auto states, auto scores, auto next, auto failed) {
    step(phase, states, scores, next, failed);
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (states[i] > 2.2) next[i] = std::numeric_limits<double>::quiet_NaN();
  };
  const std::vector<double> start{2};
  const std::string message = message_of<MapError>([&] { mesh_study(map, start); });
  EXPECT_NE(message.find("from the state x = 2."), std::string::npos) << message;
  EXPECT_NE(message.find("not finite"), std::string::npos) << message;
}

TEST(BatchMap, NamesTheStateThatLeavesTheSection) {
  BatchMap map = linear_batch(0.3);
  map.inside = [](int, auto state) { return state[0] < 2.5; };
  const std::vector<double> start{2};
  const std::string message = message_of<MapError>([&] { mesh_study(map, start); });
  EXPECT_NE(message.find("outside its own section"), std::string::npos) << message;
}

TEST(BatchMap, StartsOfAnotherLengthAreRefused) {
  const BatchMap map = linear_batch(0.7);
  const std::vector<double> good{2}, long_one{2, 1};
  const Mesh mesh(map, noise_frames(map, good), good, {.spacing = 0.5});
  EXPECT_THROW(noise_frames(map, long_one), std::invalid_argument);
  EXPECT_THROW(Mesh(map, noise_frames(map, good), long_one, {.spacing = 0.5}), std::invalid_argument);
  EXPECT_THROW(mesh_passage(mesh, {}), std::invalid_argument);
  EXPECT_THROW(guided_failure_rate(map, mesh, long_one, {}), std::invalid_argument);
  EXPECT_THROW(simulate_steps(map, {}, {}), std::invalid_argument);
}

TEST(BatchMap, ThatNeverFailsIsNamed) {
  BatchMap map = linear_batch(0.3);
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + 0.3 * std::tanh(scores[i]);
      failed[i] = 0;
    }
  };
  const std::vector<double> start{2};
  const std::string message = message_of<MapError>([&] { mesh_study(map, start); });
  EXPECT_NE(message.find("no failure is found within an action of 60"), std::string::npos) << message;
  EXPECT_NE(message.find("x = 2"), std::string::npos) << message;
}

TEST(BatchMap, ThatFailsWithoutNoiseOrDoesNotSettleIsNamed) {
  BatchMap map = linear_batch(0.3);
  const std::vector<double> start{2}, falling{-10};
  EXPECT_NE(message_of<MapError>([&] { mesh_study(map, falling); }).find("even without noise"), std::string::npos);
  map.step = [](int, auto states, auto, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = -states[i];
      failed[i] = 0;
    }
  };
  EXPECT_NE(message_of<MapError>([&] { mesh_study(map, start); }).find("does not settle"), std::string::npos);
}

TEST(BatchMap, ThatDrawsForItselfIsSimulatedOnlyAndToldSo) {
  BatchMap map;
  map.scores = 0;
  map.draw = [](int, auto, auto words, auto next, auto failed) {  // fails one time in ten, whatever the state
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = 0;
      failed[i] = static_cast<double>(words[i]) < 0x1p64 / 10;
    }
  };
  const std::vector<double> start{0};
  EXPECT_NE(message_of<MapError>([&] { mesh_study(map, start); }).find("simulated and split only"), std::string::npos);
  const auto simulated = simulate_steps(map, start, {.trials = 20000});
  ASSERT_TRUE(simulated);
  EXPECT_NEAR(simulated->mean, 10, 4 * simulated->standard_error);
  EXPECT_NEAR(simulated->standard_error, std::sqrt(90.0 / 20000), 0.005);  // geometric: variance (1 - p) / p^2
}

TEST(BatchSimulation, AgreesWithQuadratureAndNotWithThreads) {
  const std::vector<double> start{2};
  const BatchMap map = linear_batch(1.0);
  const auto one = simulate_steps(map, start, {.trials = 4000, .seed = 3, .threads = 1});
  const auto three = simulate_steps(map, start, {.trials = 4000, .seed = 3, .threads = 3});
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->steps, three->steps);
  EXPECT_NEAR(one->mean, linear_steps(1.0, 2), 4 * one->standard_error);
  EXPECT_FALSE(simulate_steps(map, start, {.trials = 4000, .most_steps = 5000}));
}

// An orbit at pi, where the map wraps its angle, is that of the same map about 0.
TEST(WithAngles, AnOrbitMayLieWhereAnglesWrap) {
  const double pi = std::numbers::pi;
  const auto leading = [](double around) {
    BatchMap map;
    map.step = [around](int, auto states, auto scores, auto next, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) {
        const double beside = std::remainder(states[i] - around, 2 * std::numbers::pi) / 2 + scores[i];
        next[i] = std::remainder(around + beside, 2 * std::numbers::pi);
        failed[i] = std::abs(beside) > 2.5;
      }
    };
    return map;
  };
  const MeshStudyOptions options{.guided_samples = 0, .simulated_steps = 0};
  const double about_zero = mesh_study(leading(0), std::vector<double>{0}, options).steps.value;
  EXPECT_THROW(mesh_study(leading(pi), std::vector<double>{pi}, options), MapError);  // a jump on its orbit
  const BatchMap wrapped = with_angles(leading(pi), {0}, std::vector<double>{3});
  EXPECT_NEAR(mesh_study(wrapped, std::vector<double>{pi}, options).steps.value / about_zero, 1, 1e-3);
  EXPECT_THROW(with_angles(leading(pi), {1}, std::vector<double>{3}), std::invalid_argument);
  EXPECT_THROW(with_angles(leading(pi), {-1}, std::vector<double>{3}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
