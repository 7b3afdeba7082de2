#include "markov/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <vector>

namespace metastable::markov {
namespace {

TEST(Parallel, EveryIndexIsCalledOnce) {
  for (const int threads : {1, 2, 7}) {
    std::vector<std::atomic<int>> calls(1000);
    parallel_for(calls.size(), threads, [&](std::size_t i) { ++calls[i]; });
    for (const auto& count : calls) EXPECT_EQ(count.load(), 1);
  }
  parallel_for(0, 2, [](std::size_t) { FAIL(); });
}

TEST(Parallel, AnExceptionComesBackToTheCaller) {
  for (const int threads : {1, 3})
    EXPECT_THROW(parallel_for(100, threads,
                              [](std::size_t i) {
                                if (i == 17) throw std::runtime_error("seventeen");
                              }),
                 std::runtime_error);
}

TEST(Parallel, AListenerHearsOneCallAtATime) {
  int inside = 0, most = 0, calls = 0;
  const auto heard = one_at_a_time([&] {
    most = std::max(most, ++inside);
    ++calls;
    --inside;
  });
  parallel_for(5000, 4, [&](std::size_t) { heard(); });
  EXPECT_EQ(calls, 5000);
  EXPECT_EQ(most, 1);
  EXPECT_NO_THROW(one_at_a_time({})());
  EXPECT_THROW(parallel_for(2, 2, [](std::size_t) { one_at_a_time([] { throw std::runtime_error("no"); })(); }),
               std::runtime_error);
}

TEST(Parallel, ToldOfProgressMayEndTheWork) {
  std::atomic<int> told = 0, done = 0;
  parallel_for(
      2500, 2, [](std::size_t) {},
      [&](double share) {
        EXPECT_TRUE(share > 0 && share <= 1);
        ++told;
      });
  EXPECT_EQ(told, 1000);
  EXPECT_THROW(parallel_for(
                   2500, 1, [&](std::size_t) { ++done; }, [](double) { throw std::runtime_error("enough"); }),
               std::runtime_error);
  EXPECT_EQ(done, 3);  // the third of 2500 completes the first thousandth
}

TEST(Parallel, ThreadCountIsAtLeastOne) {
  EXPECT_EQ(thread_count(3), 3);
  EXPECT_GE(thread_count(0), 1);
}

}  // namespace
}  // namespace metastable::markov
