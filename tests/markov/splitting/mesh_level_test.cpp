// Tests levels read off a mesh against the chance of failing by quadrature, and studies that split by them.

#include "markov/splitting/mesh_level.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "markov/mesh/mesh.h"
#include "markov/mesh/noise_frame.h"
#include "markov/splitting/splitting_study.h"
#include "tests/markov/mesh/maps.h"
#include "tests/markov/splitting/ladder.h"

namespace metastable::markov::testing {
namespace {

/// Returns the chances that the line fails within a window from each of some states, by even nodes.
std::vector<double> chances(double sd, int window, const std::vector<double>& states) {
  constexpr std::size_t nodes = 300;
  const double width = (2 + 9 * sd) / nodes;
  const auto place = [&](std::size_t i) { return (static_cast<double>(i) + 0.5) * width; };
  const auto fails = [&](double x) { return 0.5 * std::erfc((x / 2 + 1) / sd / std::sqrt(2.0)); };
  std::vector<double> now(nodes, 0.0);
  const auto one_more = [&](double x) {
    double sum = fails(x);
    for (std::size_t j = 0; j < nodes; ++j) {
      const double z = (place(j) - x / 2 - 1) / sd;
      sum += width * std::exp(-0.5 * z * z) / (sd * std::sqrt(2 * M_PI)) * now[j];
    }
    return sum;
  };
  for (int n = 1; n < window; ++n) {
    std::vector<double> next;
    for (std::size_t i = 0; i < nodes; ++i) next.push_back(one_more(place(i)));
    now = next;
  }
  std::vector<double> found;
  for (const double x : states) found.push_back(one_more(x));
  return found;
}

TEST(MeshLevel, IsTheChanceOfFailingWithinTheWindow) {
  const MeshLevel read = mesh_level(linear_batch(0.5), std::vector{2.0}, {.spacing = 0.25, .margin = 12});
  const std::vector<double> states{0.2, 0.6, 1.1, 1.5, 2.0, 2.4};
  std::vector<double> levels(states.size());
  read.level(0, states, levels);
  EXPECT_GT(read.window, 3);
  EXPECT_LT(read.window, 60);
  const std::vector<double> known = chances(0.5, read.window, states);
  for (std::size_t i = 0; i < states.size(); ++i) EXPECT_NEAR(levels[i], std::log(known[i]), 0.15) << states[i];
  EXPECT_GT(read.calls, read.nodes);
}

// A coarse mesh is as good a guide: a state off the mesh is taken for one that hardly fails, and levels are finite.
TEST(MeshLevel, IsFiniteOffTheMesh) {
  const MeshLevel read = mesh_level(linear_batch(0.4), std::vector{2.0});
  std::vector<double> states{0.5, 2, 1e6}, levels(3);
  read.level(0, states, levels);
  EXPECT_GT(levels[0], levels[1]);
  EXPECT_GT(levels[1], levels[2]);
  EXPECT_TRUE(std::isfinite(levels[2]));
}

TEST(MeshLevel, OfSeveralPhasesGoesByThePhase) {
  const MeshLevel read = mesh_level(two_phase_batch(0.6), std::vector{2.0});
  std::vector<double> states{0.3}, first(1), second(1);
  read.level(0, states, first);   // this step fails below 0
  read.level(1, states, second);  // this one below -1
  EXPECT_GT(first[0], second[0]);
}

/// Without noise 1 and -1 follow each other, and 0 is unstable.
TEST(MeshLevel, LiesAroundTheGaitThatAnUnstableStartLeadsTo) {
  const MeshLevel read = mesh_level(cubic_batch(0.2), std::vector{0.0});
  std::vector<double> states{1.7, -1.7, 1}, levels(3);
  read.level(0, states, levels);
  EXPECT_GT(levels[0], levels[2]);
  EXPECT_GT(levels[1], levels[2]);
}

TEST(MeshLevel, WantsAMapThatMeshesTake) {
  BatchMap five = linear_batch(0.5);
  five.dimension = 5, five.names = {};
  EXPECT_THROW(mesh_level(five, std::vector<double>(5, 0)), TooManyDimensions);
  EXPECT_THROW(mesh_level(Ladder{}.drawing(), std::vector{0.0}), MapError);
}

std::string refusal(const BatchMap& map, const MeshLevelOptions& options) {
  try {
    mesh_level(map, std::vector{2.0}, options);
  } catch (const NoSplitting& error) {
    return fmt::format("no number: {}", error.what());
  } catch (const NoFailureFound& error) {
    return fmt::format("no failure: {}", error.what());
  } catch (const std::length_error& error) {
    return fmt::format("memory: {}", error.what());
  }
  return "";
}

TEST(MeshLevel, EndsWhereItWouldTakeMoreThanIsAllowed) {
  const BatchMap map = linear_batch(0.4);
  const MeshLevel read = mesh_level(map, std::vector{2.0});
  EXPECT_EQ(refusal(map, {.most_calls = read.calls}), "");
  EXPECT_EQ(refusal(map, {.most_calls = 100}),
            "no number: splitting: a mesh's level would take more than 100 steps of the map (a learnt level takes "
            "fewer): no number is given");
  EXPECT_TRUE(refusal(map, {.most_bytes = 100}).starts_with("memory: a mesh's level: mesh: spacing 1 takes more than"));
  EXPECT_THROW(splitting_study(map, std::vector{2.0}, {.level_of_mesh = true, .level_bytes = 100}), std::length_error);
  EXPECT_THROW(splitting_study(map, std::vector{2.0}, {.level_of_mesh = true, .most_calls = 400}), NoSplitting);
}

TEST(MeshLevel, SaysThatItFindsNoFailure) {
  BatchMap map = linear_batch(0.4);
  map.step = [step = map.step](int phase, auto states, auto scores, auto next, auto failed) {
    step(phase, states, scores, next, failed);
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (failed[i]) failed[i] = 0, next[i] = 0;
  };
  EXPECT_TRUE(refusal(map, {}).starts_with("no failure: a mesh's level: return map: no failure is found within"));
}

TEST(MeshLevel, TellsOfItsSteps) {
  struct Stopped {};
  int told = 0;
  mesh_level(linear_batch(0.4), std::vector{2.0}, {.told = [&] { ++told; }});
  EXPECT_GT(told, 3);
  const auto stop = [&] {
    if (--told == 0) throw Stopped();
  };
  EXPECT_THROW(mesh_level(linear_batch(0.4), std::vector{2.0}, {.told = stop}), Stopped);
}

const SplittingOptions by_mesh{
    .level_of_mesh = true, .replicas = 200, .rounds = 8, .pilots = 2, .tolerance = 0.3, .seed = 3, .threads = 1};

TEST(SplittingStudy, SplitsByAMeshsLevel) {
  for (const double sd : {0.6, 0.4, 0.33}) {
    const SplittingStudy study = splitting_study(linear_batch(sd), std::vector{2.0}, by_mesh);
    EXPECT_EQ(study.disagreement, "");
    EXPECT_EQ(study.split_by, SplitBy::mesh);
    EXPECT_GT(study.level_nodes, 3U);
    const double half = 0.5 * std::log(study.steps.upper / study.steps.lower);
    EXPECT_LT(std::abs(std::log(study.steps.value / linear_steps(sd, 2))), 2 * half + 0.05) << sd;
  }
}

TEST(SplittingStudy, SaysWhatItIsSplitBy) {
  SplittingOptions options = by_mesh;
  options.level = [](int, auto states, auto levels) {
    for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = -states[i];
  };
  EXPECT_THROW(splitting_study(linear_batch(0.4), std::vector{2.0}, options), std::invalid_argument);
  options.level_of_mesh = false;
  EXPECT_EQ(splitting_study(linear_batch(0.4), std::vector{2.0}, options).split_by, SplitBy::given);
  options.level = {};
  EXPECT_EQ(splitting_study(linear_batch(0.4), std::vector{2.0}, options).split_by, SplitBy::learnt);
  EXPECT_EQ(splitting_study(linear_batch(1.5), std::vector{2.0}, options).split_by, SplitBy::nothing);
}

}  // namespace
}  // namespace metastable::markov::testing
