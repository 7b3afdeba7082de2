#include "markov/ranks/shared_passage.h"

#include <algorithm>

#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/mesh/maps.h"
#include "tests/markov/ranks/ranks_of_tests.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h, ranks_of_tests.h

const std::vector<double> middle{2};

// Elimination has full relative accuracy in every entry: about 30, 2e4 and 5e11 steps.
TEST(SharedPassage, IsWhatEliminationSaysOfEveryNode) {
  for (const double sd : {1.0, 0.45, 0.25}) {
    const BatchMap map = linear_batch(sd);
    const auto frames = noise_frames(map, middle);
    const MeshOptions options{.spacing = 0.1, .score_spacing = 0.3};
    const Mesh mesh(map, frames, middle, options);
    const SharedMesh shared(map, frames, middle, options, ranks());
    EXPECT_EQ(shared.nodes(), mesh.size());
    const ChainSolver solver(mesh.chain());
    const std::vector<double> mean = mean_first_passage(solver);
    const QuasiStationary quasi = quasi_stationary(solver);
    const SharedPassage all = shared_passage(shared);
    EXPECT_NEAR(all.failure_rate / quasi.failure_rate, 1, 1e-11) << sd;
    for (std::size_t i = 0; i < shared.size(); ++i) {
      const std::uint32_t node = same_node(mesh, shared, i);
      EXPECT_NEAR(all.expected_steps[i] / mean[node], 1, 1e-11) << sd;
      EXPECT_NEAR(all.distribution[i] / quasi.distribution[node], 1, 1e-10) << sd;
    }
  }
}

TEST(SharedPassage, TakesTurnsAtThePhases) {
  expect_same_as_one_process(two_phase_batch(0.45), middle, {.spacing = 0.1, .score_spacing = 0.3});
}

TEST(SharedPassage, SurvivorsAreFollowedAlike) {
  const BatchMap map = skew_batch(1.0);
  const std::vector<double> start{2, -2.0 / 3};
  const auto frames = noise_frames(map, start);
  const MeshOptions options{.spacing = 0.8, .margin = 6};
  const SharedMesh shared(map, frames, start, options, ranks());
  const MeshPassage all = follow_survivors(shared.rows(), {shared.start().begin(), shared.start().end()});
  const MeshPassage one = mesh_passage(Mesh(map, frames, start, options), start);
  EXPECT_EQ(all.products, one.products);
  EXPECT_NEAR(all.steps / one.steps, 1, 1e-12);
  EXPECT_NEAR(all.steps_lower / one.steps_lower, 1, 1e-12);
  EXPECT_NEAR(all.failure_rate / one.failure_rate, 1, 1e-12);
}

TEST(SharedMesh, AllRanksHearOfWhatIsWrong) {
  BatchMap map = linear_batch(0.5);
  const auto frames = noise_frames(map, middle);
  EXPECT_THROW(SharedMesh(map, frames, middle, {.spacing = 0.05, .most_bytes = 1000}, ranks()), std::length_error);
  const auto step = map.step;
  map.step = [step](int phase, auto states, auto scores, auto next, auto failed) {
    step(phase, states, scores, next, failed);
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (states[i] > 2.9) next[i] = NAN;
  };
  const std::string message =
      message_of<MapError>([&] { SharedMesh(map, frames, middle, {.spacing = 0.05}, ranks()); });
  EXPECT_NE(message.find("not finite"), std::string::npos) << message;
  EXPECT_EQ(ranks().first_text(message), message);  // the same words on all
}

TEST(Ranks, ExchangeWhatTheySay) {
  Ranks& all = ranks();
  const double own = all.rank() + 1, n = all.ranks();
  EXPECT_EQ(all.sum(own), n * (n + 1) / 2);
  EXPECT_EQ(all.largest(own), n);
  EXPECT_EQ(all.sum_before(own), all.rank() * own / 2);
  std::vector<std::vector<Exchange::Note>> to(static_cast<std::size_t>(all.ranks()));
  for (std::size_t r = 0; r < to.size(); ++r) to[r].assign(r, {static_cast<std::uint64_t>(all.rank()), own});
  const auto from = all.swap(to);
  for (std::size_t r = 0; r < from.size(); ++r) {
    ASSERT_EQ(from[r].size(), static_cast<std::size_t>(all.rank()));
    for (const Exchange::Note& note : from[r]) EXPECT_EQ(note.key, r);
  }
  if (all.rank() > 0) {
    all.send("first of " + std::to_string(all.rank()));
    all.send("");
  }
  for (int r = 1; all.rank() == 0 && r < all.ranks(); ++r) {
    EXPECT_EQ(all.receive(r, [] {}), "first of " + std::to_string(r));
    EXPECT_EQ(all.receive(r, [] {}), "");
  }
}

}  // namespace
}  // namespace metastable::markov
