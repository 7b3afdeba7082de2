// Probabilities that span many decades, held against elimination, whose every entry is right.

#include "markov/passage/nested_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "markov/passage/bounded_passage.h"
#include "markov/passage/last_steps.h"

namespace metastable::markov {
namespace {

/// Ten blocks on a ring, the states of each linked at random. Every state leads to the next block and to the one
/// before.
Chain ring_of_blocks(std::size_t block, double coupling, double kill) {
  constexpr std::size_t blocks = 10;
  std::mt19937_64 engine(5);
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value;
  const auto any_of = [&](std::size_t of) {
    return static_cast<std::uint32_t>(of % blocks * block + engine() % block);
  };
  for (std::size_t i = 0; i < blocks * block; ++i) {
    const std::size_t own = i / block;
    std::map<std::uint32_t, double> row;
    for (int k = 0; k < 7; ++k) row[any_of(own)] += 0.1;
    row.erase(static_cast<std::uint32_t>(i));
    row[any_of(own + 1)] += coupling;
    row[any_of(own + blocks - 1)] += 0.1 * coupling;
    for (const auto& [to, probability] : row) {
      column.push_back(to);
      value.push_back(probability);
    }
    start.push_back(column.size());
  }
  return Chain(start, column, value, std::vector<double>(blocks * block, kill));
}

TEST(NestedSolver, KeepsTheDigitsOfProbabilitiesThatAreTiny) {
  const Chain chain = ring_of_blocks(40, 1e-9, 1e-6);
  std::vector<std::uint8_t> set(chain.size(), 0);
  set[3] = 1;
  const PassageTo exact = passage_by_elimination(chain, set);
  const BoundedPassage iterated = bounded_passage_to(chain, set, Heard([] {}, 0));
  EXPECT_LT(*std::min_element(exact.reach.begin(), exact.reach.end()), 1e-15);
  EXPECT_LE(iterated.error, 1e-9);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    ASSERT_NEAR(iterated.passage.reach[i] / exact.reach[i], 1, iterated.error + 1e-12) << i;
    ASSERT_NEAR(iterated.passage.fail[i], exact.fail[i], exact.fail[i] * (iterated.error + 1e-12)) << i;
  }
}

TEST(NestedSolver, IsTheSolverItselfWhereEntriesAreAlike) {
  const Chain chain = ring_of_blocks(40, 1e-2, 1e-3);
  const std::vector<std::uint8_t> all(chain.size(), 1);
  GeneratorSolver whole(generator_of(chain), Heard([] {}, 0));
  ASSERT_TRUE(whole.iterates());
  const std::vector<Extended> ones(chain.size(), 1);
  const SplitVector nested = NestedSolver(chain, whole, all, {}).solve(ones), plain = whole.solve_split(ones);
  for (std::size_t i = 0; i < chain.size(); ++i) ASSERT_EQ(nested.sum(i), plain.sum(i)) << i;
}

}  // namespace
}  // namespace metastable::markov
