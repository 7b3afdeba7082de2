// Checks how a walker falls by splitting against its mesh.

#include "analysis/walkers/split_falls.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
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

markov::SplittingStudy split(const markov::BatchMap& map, std::uint64_t seed = 3, int rounds = 8) {
  return markov::splitting_study(map, std::vector{2.0},
                                 {.replicas = 300,
                                  .rounds = rounds,
                                  .pilots = 2,
                                  .tolerance = 0.3,
                                  .seed = seed,
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

/// Returns the median of the state in which the last step of the line begins: the quasi-stationary density, by even
/// nodes, times the chance of failing.
double median_of_the_last_state() {
  constexpr std::size_t nodes = 400;
  constexpr double top = 7, width = top / nodes, sd = 0.6;
  const auto place = [](std::size_t i) { return (static_cast<double>(i) + 0.5) * width; };
  std::vector<double> density(nodes, 1.0 / nodes);
  for (int n = 0; n < 40; ++n) {
    std::vector<double> after(nodes, 0.0);
    double whole = 0;
    for (std::size_t i = 0; i < nodes; ++i)
      for (std::size_t j = 0; j < nodes; ++j) {
        const double z = (place(j) - place(i) / 2 - 1) / sd;
        after[j] += density[i] * std::exp(-0.5 * z * z);
      }
    for (const double one : after) whole += one;
    for (std::size_t i = 0; i < nodes; ++i) density[i] = after[i] / whole;
  }
  std::vector<double> places, weights;
  for (std::size_t i = 0; i < nodes; ++i) {
    places.push_back(place(i));
    weights.push_back(density[i] * std::erfc((place(i) / 2 + 1) / sd / std::sqrt(2.0)));
  }
  return weighted_quantile(places, weights, 0.5);
}

TEST(SplitFalls, IntervalsHoldTheMedianByQuadrature) {
  const markov::BatchMap map = line();
  const double known = median_of_the_last_state();
  int held = 0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const LastMoments found = how_it_falls(map, noises, split(map, seed, 16));
    ASSERT_EQ(found.reason, "");
    for (const StepProfile& step : found.last) {
      ASSERT_EQ(step.state_95.size(), 1u);
      EXPECT_LE(step.state_95[0].median.lower, step.state[0].value);
      EXPECT_GE(step.state_95[0].median.upper, step.state[0].value);
      EXPECT_LE(step.noise_95[0].median.lower, step.noise[0].value);
    }
    const Estimate& median = found.last[0].state_95[0].median;
    EXPECT_LT(median.upper - median.lower, 0.3);
    held += median.lower <= known && known <= median.upper;
    EXPECT_EQ(found.regime.noise_95[0].median.lower, 0);  // as given
  }
  EXPECT_GE(held, seeds - 4);
}

TEST(SplitFalls, AreNotToldWhereTheRoundsLieTooFarApart) {
  const markov::BatchMap map = line();
  markov::SplittingStudy study = split(map);
  for (std::size_t walk = 0; walk < study.failing_ends[3]; ++walk)
    for (std::size_t k = 0; k < study.failing.steps; ++k)
      study.failing.states[walk * study.failing.steps + k] += 10;  // half of the rounds fail elsewhere
  EXPECT_EQ(how_it_falls(map, noises, study).reason,
            "the rounds lie too far apart to tell the median of x in the step that fails");
}

TEST(SplitFalls, WantANoiseForEachScore) {
  const markov::BatchMap map = line();
  const markov::SplittingStudy study = split(map);
  EXPECT_EQ(message_of<std::invalid_argument>([&] { how_it_falls(map, {}, study); }),
            "how it falls: one noise for each score expected");
}

}  // namespace
}  // namespace metastable::analysis
