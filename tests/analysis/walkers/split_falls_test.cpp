// Checks how a walker falls by splitting against its mesh.

#include "analysis/walkers/split_falls.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

const std::vector<NamedNoise> noises{{"z [sd]"}};

markov::BatchMap line() {
  markov::BatchMap map;
  map.names = {"x"};
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + 0.6 * scores[i];
      failed[i] = next[i] <= 0;
    }
  };
  return map;
}

markov::SplittingStudy split(const markov::BatchMap& map) {
  return markov::splitting_study(map, std::vector{2.0},
                                 {.replicas = 300,
                                  .rounds = 8,
                                  .pilots = 2,
                                  .tolerance = 0.3,
                                  .seed = 3,
                                  .threads = 1,
                                  .last_steps = steps_of_a_fall});
}

TEST(SplitFalls, AreThoseOfTheMesh) {
  const markov::BatchMap map = line();
  const markov::MeshStudyOptions options{.spacing = 0.3, .threads = 1, .guided_samples = 0, .simulated_steps = 0};
  const markov::MeshStudy mesh = markov::mesh_study(map, std::vector{2.0}, options);
  const LastMoments known = how_it_falls(map, std::vector{2.0}, noises, mesh, options).moments;
  const LastMoments found = how_it_falls(map, noises, split(map));
  ASSERT_EQ(found.last.size(), known.last.size());
  const double all = known.regime.state[0].upper - known.regime.state[0].lower;
  EXPECT_NEAR(found.regime.state[0].value, known.regime.state[0].value, 0.05 * all);
  for (std::size_t k = 0; k < found.last.size(); ++k) {
    EXPECT_NEAR(found.last[k].state[0].value, known.last[k].state[0].value, 0.1 * all) << k;
    EXPECT_NEAR(found.last[k].noise[0].value, known.last[k].noise[0].value, 0.35) << k;
    EXPECT_TRUE(std::isnan(found.last[k].bound_to_fail));
  }
  ASSERT_EQ(found.by_phase.size(), 1u);
  EXPECT_NEAR(found.by_phase[0], 1, 1e-12);
  EXPECT_EQ(found.state_names, std::vector<std::string>{"x"});
  // The path of least noise leads from step to step, and fails.
  ASSERT_EQ(found.likeliest.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    const double next = found.likeliest[k].state[0] / 2 + 1 + 0.6 * found.likeliest[k].noise[0];
    if (k + 1 < 6)
      EXPECT_NEAR(next, found.likeliest[k + 1].state[0], 1e-12);
    else
      EXPECT_LE(next, 0);
  }
}

TEST(SplitFalls, WantANoiseForEachScore) {
  const markov::BatchMap map = line();
  const markov::SplittingStudy study = split(map);
  EXPECT_EQ(message_of<std::invalid_argument>([&] { how_it_falls(map, {}, study); }),
            "how it falls: one noise for each score expected");
}

}  // namespace
}  // namespace metastable::analysis
