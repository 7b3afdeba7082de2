#include "markov/chain/period.h"

#include <gtest/gtest.h>

#include "tests/markov/reference_chains.h"

namespace metastable::markov {
namespace {

Chain ring(std::size_t n) {
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) matrix[i * n + (i + 1) % n] = 1;
  return Chain::from_dense(n, matrix, std::vector<double>(n, 0.0));
}

void expect_cyclic(const Chain& chain, const Period& period) {
  ASSERT_EQ(period.state_class.at(0), 0);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    for (const std::uint32_t j : chain.columns(i)) {
      EXPECT_EQ(period.state_class[j], (period.state_class[i] + 1) % period.period) << i << " -> " << j;
    }
  }
  std::size_t states = 0;
  for (std::size_t c = 0; c < period.classes.size(); ++c) {
    states += period.classes[c].size();
    for (const std::uint32_t i : period.classes[c]) EXPECT_EQ(period.state_class[i], static_cast<int>(c));
  }
  EXPECT_EQ(states, chain.size());
}

TEST(FindPeriod, RingOfNHasPeriodN) {
  for (const std::size_t n : {2, 3, 8, 100}) {
    const Period period = find_period(ring(n));
    EXPECT_EQ(period.period, static_cast<int>(n));
    expect_cyclic(ring(n), period);
  }
}

TEST(FindPeriod, CyclicClassesOfSeveralStates) {
  const Chain chain = reference::cyclic_chain(8, 5, 1, 0.1);
  const Period period = find_period(chain);
  EXPECT_EQ(period.period, 8);
  expect_cyclic(chain, period);
  EXPECT_EQ(period.classes[3].size(), 5u);
}

// There are cycles of 4 and of 6 through state 0.
TEST(FindPeriod, IsTheGreatestCommonDivisorOfTheCycles) {
  std::vector<double> matrix(64, 0.0);
  const auto link = [&matrix](int from, int to, double p) { matrix[static_cast<std::size_t>(8 * from + to)] = p; };
  link(0, 1, 1), link(1, 2, 1), link(2, 3, 1), link(3, 0, 0.5), link(3, 4, 0.5), link(4, 5, 1), link(5, 0, 1);
  link(6, 0, 1), link(7, 6, 1);  // and a way in from outside
  const Chain chain = Chain::from_dense(8, matrix, std::vector<double>(8, 0.0));
  const Period period = find_period(chain);
  EXPECT_EQ(period.period, 2);
  expect_cyclic(chain, period);
}

TEST(FindPeriod, StayingAnywhereMakesItOne) {
  const Chain walk = reference::birth_death(6, 0.25, 0.25, true);
  EXPECT_EQ(find_period(walk).period, 1);
  EXPECT_EQ(find_period(reference::birth_death(6, 0.5, 0.5, true)).period, 2);
  EXPECT_EQ(find_period(reference::birth_death(6, 0.5, 0.5, false)).period, 1);  // the reflecting end stays
  EXPECT_EQ(find_period(walk).classes.at(0).size(), 6u);
}

TEST(FindPeriod, RoundingOfRowSumsIsNoStaying) {
  const Chain chain({0, 1, 2}, {1, 0}, {1 - 1e-13, 1 - 1e-16}, {0, 0});
  EXPECT_EQ(find_period(chain).period, 2);
}

TEST(FindPeriod, PartsWithoutACycleDoNotLowerIt) {
  // It has a ring of 3, and a path that ends at rest.
  const Chain chain({0, 1, 2, 3, 4, 5, 5}, {1, 2, 0, 4, 5}, {1, 1, 1, 1, 1}, {0, 0, 0, 0, 0, 1});
  const Period period = find_period(chain);
  EXPECT_EQ(period.period, 3);
  expect_cyclic(chain, period);
  // This is only a path: it has no cycle at all.
  EXPECT_EQ(find_period(Chain({0, 1, 1}, {1}, {1}, {0, 1})).period, 1);
}

TEST(FindPeriod, PartsShareTheirDivisor) {
  // There are rings of 4 and of 6.
  std::vector<double> matrix(100, 0.0);
  for (std::size_t i = 0; i < 4; ++i) matrix[i * 10 + (i + 1) % 4] = 1;
  for (std::size_t i = 0; i < 6; ++i) matrix[(4 + i) * 10 + 4 + (i + 1) % 6] = 1;
  EXPECT_EQ(find_period(Chain::from_dense(10, matrix, std::vector<double>(10, 0.0))).period, 2);
}

}  // namespace
}  // namespace metastable::markov
