#include "markov/mesh/blind_spots.h"

#include <gtest/gtest.h>

#include <cmath>

#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/mesh_study.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

BlindSpots spots_of(const BatchMap& map) {
  const std::vector<double> start{0};
  const auto frames = noise_frames(map, start);
  const MeshOptions options{.spacing = 0.4, .score_spacing = 0.8};
  const Mesh mesh(map, frames, start, options);
  return find_blind_spots(map, frames, mesh, mesh_passage(mesh, start).visits, options);
}

TEST(BlindSpots, MeasureABandThatIsSteppedOver) {
  // The mesh says 4.92e6 steps. A score in (2, 2.01) has a probability of 5.345e-4: 2630 failures in that time.
  const BlindSpots band = spots_of(damped_batch([](double, double z, double) { return z > 2 && z < 2.01; }));
  EXPECT_GT(band.hits, 5u);
  EXPECT_GT(band.missed, 2630 * 0.8);
  EXPECT_LT(band.missed, 2630 * 2.5);  // it is a bound, of two standard errors
  // A landing within 0.001 of 4, and a start in (4, 4.05), happen in one step of 1e6 and 2e4.
  EXPECT_GT(spots_of(damped_batch([](double, double, double x) { return std::abs(x - 4) < 1e-3; })).missed, 1);
  EXPECT_GT(spots_of(damped_batch([](double s, double, double) { return s > 4 && s < 4.05; })).missed, 1);
}

TEST(BlindSpots, AreNoneOfSmoothMaps) {
  const BlindSpots none = spots_of(damped_batch([](double, double, double) { return false; }));
  EXPECT_EQ(none.hits, 0u);
  EXPECT_EQ(none.missed, 0);
  EXPECT_EQ(none.probes, 48000u);
}

TEST(BlindSpots, DoNotTakeOneScoresFailuresForAnothers) {
  // Which of the two scores fails it must not matter to a mesh that lands curves in the first.
  for (const std::size_t which : {0, 1}) {
    BatchMap map;
    map.dimension = map.scores = 2;
    map.step = [which](int, auto states, auto scores, auto next, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) {
        next[2 * i] = states[2 * i] / 2 + scores[2 * i];
        next[2 * i + 1] = states[2 * i + 1] / 3 + scores[2 * i + 1];
        failed[i] = scores[2 * i + which] > 3;
      }
    };
    const std::vector<double> start{0, 0};
    const auto frames = noise_frames(map, start);
    const MeshOptions options{.spacing = 1, .margin = 6, .score_spacing = 0.6};
    const Mesh mesh(map, frames, start, options);
    const BlindSpots spots = find_blind_spots(map, frames, mesh, mesh_passage(mesh, start).visits, options);
    EXPECT_LT(spots.missed, 0.01) << which;
  }
}

bool jumps(const BatchMap& map) {
  const std::vector<double> start{0};
  const auto frames = noise_frames(map, start);
  const MeshOptions options{.spacing = 0.4, .score_spacing = 0.8};
  const Mesh mesh(map, frames, start, options);
  return failing_jumps(map, frames, mesh, mesh_passage(mesh, start).visits, options);
}

TEST(FailingJumps, AreThoseOfTheStateBeforeTheStep) {
  EXPECT_TRUE(jumps(damped_batch([](double before, double, double) { return before > 2.5; })));
  EXPECT_TRUE(jumps(damped_batch([](double before, double z, double) { return before > 2.5 && z > 0.5; })));
  EXPECT_FALSE(jumps(damped_batch([](double, double, double after) { return after > 2.5; })));
  EXPECT_FALSE(jumps(damped_batch([](double, double z, double) { return z > 2.5; })));
  EXPECT_FALSE(jumps(damped_batch([](double, double, double) { return false; })));
}

// The reference is elimination on even cells of 0.01 over (-7, 7), of which half the width changes no digit.
TEST(FailingJumps, DoNotWidenTheInterval) {
  const BatchMap map = damped_batch([](double before, double, double) { return std::abs(before) > 2.5; });
  const std::vector<double> start{0};
  const MeshStudy study = mesh_study(map, start, {.guided_samples = 0, .simulated_steps = 0});
  EXPECT_GT(study.row_states, 1);
  EXPECT_LT(study.steps.lower, 39.858);
  EXPECT_GT(study.steps.upper, 39.858);
  EXPECT_LT(study.steps.upper, 1.05 * study.steps.lower);
}

}  // namespace
}  // namespace metastable::markov
