#include "markov/mesh/joined_steps.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "markov/mesh/mesh_study.h"
#include "tests/markov/mesh/maps.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using testing::linear_batch;

struct Counted {
  BatchMap map;
  std::vector<std::size_t> rows;  ///< of each call
};

/// Makes a map note how many rows each of its calls has.
void count_rows(Counted& counted) {
  counted.map.step = [&counted, step = counted.map.step, lock = std::make_shared<std::mutex>()](
                         int phase, auto states, auto scores, auto next, auto failed) {
    const std::lock_guard held(*lock);
    counted.rows.push_back(failed.size());
    step(phase, states, scores, next, failed);
  };
}

/// Lets work i step i + 1 times from the state i, and returns where each ended.
std::vector<double> ends(const BatchMap& map, std::size_t together, int threads) {
  std::vector<double> end(7);
  joined_for(map, end.size(), together, threads, [&](std::size_t i, const BatchMap& joined) {
    std::vector<double> state{static_cast<double>(i)}, next(1);
    std::vector<std::uint8_t> failed(1);
    for (std::size_t step = 0; step <= i; ++step) {
      joined.step(0, state, std::vector<double>{0.0}, next, failed);
      state = next;
    }
    end[i] = state[0];
  });
  return end;
}

TEST(JoinedSteps, ShareCallsThatDoNotHangOnThreads) {
  std::vector<double> alone;
  for (int i = 0; i < 7; ++i) {
    double x = i;
    for (int step = 0; step <= i; ++step) x = x / 2 + 1;
    alone.push_back(x);
  }
  for (const int threads : {1, 3}) {
    Counted counted{linear_batch(0.3), {}};
    count_rows(counted);
    EXPECT_EQ(ends(counted.map, 7, threads), alone);
    EXPECT_EQ(counted.rows, (std::vector<std::size_t>{7, 6, 5, 4, 3, 2, 1}));
  }
  Counted counted{linear_batch(0.3), {}};
  count_rows(counted);
  EXPECT_EQ(ends(counted.map, 3, 2), alone);  // work that ends is followed by the next
  EXPECT_EQ(std::accumulate(counted.rows.begin(), counted.rows.end(), std::size_t{0}), 28u);
  EXPECT_LE(counted.rows.size(), 14u);
}

TEST(JoinedSteps, ThrowWhatTheFirstWorkThrew) {
  const BatchMap map = linear_batch(0.3);
  EXPECT_EQ(message_of<std::runtime_error>([&] {
              joined_for(map, 5, 5, 2, [&](std::size_t i, const BatchMap& joined) {
                std::vector<double> state{2.0}, next(1);
                std::vector<std::uint8_t> failed(1);
                joined.step(0, state, std::vector<double>{0.0}, next, failed);
                if (i == 3) throw std::runtime_error("the third");
                for (;;) joined.step(0, state, std::vector<double>{0.0}, next, failed);
              });
            }),
            "the third");
  BatchMap broken = map;
  broken.step = [](int, auto, auto, auto, auto) { throw std::logic_error("the step"); };
  EXPECT_THROW(ends(broken, 4, 2), std::logic_error);
}

// A dear map gets the same answer in few calls.
TEST(JoinedSteps, AnswerADearMapAsAnyOther) {
  const std::vector<double> start{2};
  const auto study = [&](bool dear, int threads, std::vector<std::size_t>& rows) {
    Counted counted{linear_batch(0.6), {}};
    counted.map.dear = dear;
    count_rows(counted);
    MeshStudy found = mesh_study(counted.map, start, {.threads = threads, .simulated_steps = 200000});
    rows = std::move(counted.rows);
    return found;
  };
  std::vector<std::size_t> plain_rows, one_rows, three_rows;
  const MeshStudy plain = study(false, 1, plain_rows), one = study(true, 1, one_rows),
                  three = study(true, 3, three_rows);
  for (const MeshStudy* other : {&one, &three}) {
    EXPECT_EQ(other->steps.value, plain.steps.value);
    EXPECT_EQ(other->steps.upper, plain.steps.upper);
    EXPECT_EQ(other->failure_rate.value, plain.failure_rate.value);
    EXPECT_EQ(other->survival, plain.survival);
    ASSERT_TRUE(other->guided && plain.guided && other->simulated && plain.simulated);
    EXPECT_EQ(other->guided->value, plain.guided->value);
    EXPECT_EQ(other->simulated->value, plain.simulated->value);
    EXPECT_EQ(other->blind_spots.missed, plain.blind_spots.missed);
  }
  EXPECT_EQ(one_rows, three_rows);  // call by call
  EXPECT_LT(4 * one_rows.size(), plain_rows.size());
}

}  // namespace
}  // namespace metastable::markov
