// Chains solved by iteration, held against elimination of the same chains and against closed forms.

#include "markov/passage/bounded_passage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "markov/passage/bounded_survival.h"
#include "markov/passage/first_passage.h"
#include "markov/passage/slow_modes.h"
#include "markov/passage/survival_after.h"
#include "tests/markov/sparse_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using reference::sparse_chain;
using reference::SparseChain;

// 2900 states fill some 6e9 multiply-adds: more than GeneratorSolver eliminates, half a second for Elimination.
constexpr std::size_t states = 2900;

void expect_between(const std::vector<double>& lower, const std::vector<double>& value,
                    const std::vector<double>& upper, double rounding) {
  for (std::size_t i = 0; i < value.size(); ++i) {
    ASSERT_LE(lower[i], value[i] * (1 + rounding)) << i;
    ASSERT_GE(upper[i], value[i] * (1 - rounding)) << i;
  }
}

/// Two blocks, the states of each linked at random, that every state leaves with the same probability.
Chain blocks_apart(std::size_t block, double leave, double kill_first, double kill_second) {
  std::mt19937_64 engine(3);
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  for (std::size_t i = 0; i < 2 * block; ++i) {
    const std::size_t own = i < block ? 0 : block;
    std::map<std::uint32_t, double> row;
    for (int k = 0; k < 9; ++k) row[static_cast<std::uint32_t>(own + engine() % block)] += 0.08;
    row.erase(static_cast<std::uint32_t>(i));
    row[static_cast<std::uint32_t>(block - own + engine() % block)] = leave;
    for (const auto& [to, probability] : row) {
      column.push_back(to);
      value.push_back(probability);
    }
    start.push_back(column.size());
    kill.push_back(own == 0 ? kill_first : kill_second);
  }
  return Chain(start, column, value, kill);
}

class BoundedChains : public ::testing::TestWithParam<SparseChain> {};

TEST_P(BoundedChains, AgreesWithEliminationWithinItsBounds) {
  const Chain chain = sparse_chain(GetParam());
  ASSERT_FALSE(eliminated(generator_of(chain)));
  const BoundedSteps steps = bounded_first_passage(chain);
  const ChainSolver solver(chain);
  const std::vector<double> mean = mean_first_passage(solver), sd = first_passage_sd(solver, mean);
  expect_between(steps.bounds.lower, mean, steps.bounds.upper, 1e-11);
  for (std::size_t i = 0; i < states; ++i) ASSERT_NEAR(steps.sd[i] / sd[i], 1, 1e-8) << i;
  EXPECT_LE(steps.bounds.upper[0] / steps.bounds.lower[0] - 1, 1e-6);
  const BoundedQuasiStationary bounded = bounded_quasi_stationary(chain);
  EXPECT_LE(bounded.rate_lower, bounded.quasi.failure_rate);
  EXPECT_GE(bounded.rate_upper, bounded.quasi.failure_rate);
  EXPECT_LE(bounded.distribution_error, 1e-6) << bounded.unproven;
  // y (I - Q) = rate y, by one elimination.
  const std::vector<double> again = solver.solve_left(bounded.quasi.distribution);
  for (std::size_t i = 0; i < states; ++i)
    ASSERT_NEAR(again[i] * bounded.quasi.failure_rate, bounded.quasi.distribution[i],
                1e-8 * bounded.quasi.distribution[i])
        << i;
}

INSTANTIATE_TEST_SUITE_P(Kinds, BoundedChains,
                         ::testing::Values(SparseChain{states, 1, 0, 1, 1e-6, 0},
                                           SparseChain{states, 1, 0, 1, 1e-12, 1}, SparseChain{states, 1, 0, 1, 0.3, 0},
                                           SparseChain{states, 7, 1e-3, 1, 1e-6, 1},
                                           SparseChain{states, 7, 1e-9, 1, 1e-12, 0},
                                           SparseChain{states, 1, 0, 4, 1e-6, 0}));

// Blocks that every state leaves with the same probability to the next one, and fails from with the same one, so that
// mean and variance are those of a chain of two states.
TEST(BoundedFirstPassage, ProvesTheSdOfBlocksThatAreHardlyLeft) {
  const Extended leave = 1e-17L, rare = 1e-17L, often = 1e-3L;
  const std::size_t block = 1900;
  const Chain chain =
      blocks_apart(block, static_cast<double>(leave), static_cast<double>(rare), static_cast<double>(often));
  // (I - Q) m = 1 and (I - Q) v = g by Cramer's rule; the determinant is a sum.
  const Extended determinant = leave * rare + leave * often + rare * often;
  const Extended mean_rare = (often + 2 * leave) / determinant, mean_often = (rare + 2 * leave) / determinant;
  const auto square = [](Extended off) { return off * off; };
  const Extended apart = (often - rare) / determinant;
  const Extended g_rare = rare * square(mean_rare - 1) + leave * square(1 - apart) + 1 - leave - rare,
                 g_often = often * square(mean_often - 1) + leave * square(1 + apart) + 1 - leave - often;
  const Extended sd_rare = std::sqrt(((often + leave) * g_rare + leave * g_often) / determinant),
                 sd_often = std::sqrt((leave * g_rare + (rare + leave) * g_often) / determinant);
  const BoundedSteps steps = bounded_first_passage(chain);
  for (std::size_t i = 0; i < 2 * block; ++i)
    ASSERT_NEAR(steps.sd[i] / static_cast<double>(i < block ? sd_rare : sd_often), 1, 1e-6) << i;
}

// All states lead, alike, into 50 states that follow one another surely to rest: their sd is zero.
TEST(BoundedFirstPassage, TakesStepsThatAreSure) {
  const double enter = 1e-6;
  const Chain random = sparse_chain({states, 1, 0, 1, 0, 0});
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(states + 50, 0.0);
  kill.back() = 1;
  for (std::uint32_t i = 0; i + 1 < states + 50; ++i) {
    const std::size_t links = i < states ? random.columns(i).size() : 0;
    for (std::size_t e = 0; e < links; ++e) {
      column.push_back(random.columns(i)[e]);
      value.push_back(random.values(i)[e] * (1 - enter));
    }
    column.push_back(i < states ? states : i + 1);
    value.push_back(i < states ? enter : 1);
    start.push_back(column.size());
  }
  start.push_back(column.size());
  const BoundedSteps steps = bounded_first_passage(Chain(start, column, value, kill));
  EXPECT_NEAR(steps.sd[3] / (std::sqrt(1 - enter) / enter), 1, 1e-6);
  for (std::size_t i = states; i < states + 50; ++i) EXPECT_NEAR(steps.sd[i], 0, 1e-6);
}

TEST(StepsEnclosed, TellsHowFarAVectorBesideItsBoundsIsOff) {
  const Chain one({0, 0}, {}, {}, {0.25});
  for (const double found : {4.0, 8.0, 2.0}) {
    const SplitVector v = split(std::vector<double>{found});
    EXPECT_NEAR(error_within(steps_enclosed(one, v), v), std::abs(4 / found - 1), 1e-14) << found;
  }
}

TEST(BoundedPassageTo, AgreesWithElimination) {
  const Chain chain = sparse_chain({states, 7, 1e-3, 1, 1e-4, 0});
  std::vector<std::uint8_t> set(states, 0);
  set[1] = set[17] = 1;
  const auto bounded = bounded_passage_to(chain, set);
  const PassageQuestion question = passage_question(chain, set);
  const ChainSolver solver(question.inside);
  const std::vector<double> reach = solver.solve(question.to_set), fail = solver.solve(question.kill),
                            steps = solver.solve(std::vector<double>(states - 2, 1.0));
  EXPECT_LE(bounded.error, 1e-6);
  for (std::size_t n = 0; n < reach.size(); ++n) {
    const std::uint32_t i = question.undecided[n];
    ASSERT_NEAR(bounded.passage.reach[i] / reach[n], 1, bounded.error + 1e-11);
    ASSERT_NEAR(bounded.passage.fail[i] / fail[n], 1, bounded.error + 1e-11);
    ASSERT_NEAR(bounded.passage.steps[i] / steps[n], 1, bounded.error + 1e-11);
  }
}

/// Returns the probabilities of surviving rising numbers of steps, by as many products.
std::vector<double> followed(const Chain& chain, std::vector<double> survivors, const std::vector<double>& steps) {
  std::vector<double> told;
  double failed = 0, now = 0;
  for (const double n : steps) {
    for (; now < n; ++now) {
      for (std::size_t i = 0; i < survivors.size(); ++i) failed += survivors[i] * chain.kill(i);
      survivors = apply_left(chain, survivors);
    }
    told.push_back(1 - failed);
  }
  return told;
}

TEST(BoundedSurvival, AgreesWithFollowingEveryStep) {
  for (const std::size_t period : {1U, 4U}) {
    const Chain chain = sparse_chain({states, 1, 0, period, 1e-3, 0});
    std::vector<double> start(states, 0);
    start[3] = 1;
    const std::vector<double> steps{0, 1, 7, 3000, 4000};
    const QuasiStationary quasi = bounded_quasi_stationary(chain).quasi;
    const auto ask = [&]() -> const QuasiStationary& { return quasi; };
    const std::vector<double> all = followed(chain, start, steps);
    std::vector<double> far = steps;
    far.push_back(1e6);  // so that the survivors' settling is asked for
    const std::vector<double> bounded = bounded_survival_after(chain, start, far, ask);
    for (std::size_t q = 0; q < steps.size(); ++q) EXPECT_NEAR(bounded[q] / all[q], 1, 1e-8) << steps[q];
    EXPECT_NEAR(std::log(bounded.back() / bounded[4]) / ((1e6 - 4000) * std::log1p(-quasi.failure_rate)), 1, 1e-6);
  }
}

// Every state of a block is left, and fails, with the same probability: between the blocks this is a chain of two
// states.
TEST(BoundedSurvival, ToldBySlowModesIsThatOfTheBlocks) {
  constexpr std::size_t block = 257;
  for (const double leave : {1e-6, 1e-9}) {
    const Chain chain = blocks_apart(block, leave, 2e-8, 3e-6);
    const Chain blocks({0, 1, 2}, {1, 0}, {leave, leave}, {2e-8, 3e-6});
    std::vector<double> start(2 * block, 0);
    start[3] = 0.25;
    start[block + 7] = 0.75;
    const std::vector<double> steps{10, 1e5, 1e6, 1e7, 1e8, 5e8};
    const std::vector<double> told = survival_after(chain, start, steps),
                              known = survival_after(blocks, std::vector<double>{0.25, 0.75}, steps);
    for (std::size_t q = 0; q < steps.size(); ++q) EXPECT_NEAR(told[q] / known[q], 1, 1e-9) << leave << " " << steps[q];
  }
}

TEST(BoundedSurvival, GivesNoNumberThatItsModesDoNotProve) {
  const Chain chain = sparse_chain({360, 120, 1e-6, 1, 1e-6, 0});  // 119 slow modes
  const QuasiStationary quasi = quasi_stationary(ChainSolver(chain));
  std::vector<double> survivors(360, 0);
  survivors[3] = 1;
  const std::string told = message_of<ConvergenceError>(
      [&] { survival_by_slow_modes(chain, quasi, survivors, std::vector<double>{1e6}, widest_bound); });
  EXPECT_NE(told.find("100 slow modes do not tell"), std::string::npos) << told;
}

TEST(BoundedSurvival, FollowsAllStepsThatAreFollowedInAnyCase) {
  const Chain one({0, 0}, {}, {}, {1e-4});
  const auto never = []() -> const QuasiStationary& { throw std::logic_error("asked for what survivors look like"); };
  const double survival = bounded_survival_after(one, std::vector<double>{1}, std::vector<double>{22000}, never)[0];
  EXPECT_NEAR(survival / std::exp(22000 * std::log1p(-1e-4)), 1, 1e-12);
}

TEST(BoundedFirstPassage, NamesAStateThatCannotFail) {
  // State 0 leads to itself alone.
  Chain chain = sparse_chain({states, 1, 0, 1, 1e-3, 0});
  std::vector<std::size_t> start{0, 0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(chain.kill().begin(), chain.kill().end());
  kill[0] = 0;
  for (std::size_t i = 1; i < states; ++i) {
    column.insert(column.end(), chain.columns(i).begin(), chain.columns(i).end());
    value.insert(value.end(), chain.values(i).begin(), chain.values(i).end());
    start.push_back(column.size());
  }
  const Chain stuck(start, column, value, kill);
  EXPECT_NE(message_of<std::domain_error>([&] { bounded_first_passage(stuck); }).find("from state 0"),
            std::string::npos);
  EXPECT_EQ(bounded_quasi_stationary(stuck).quasi.failure_rate, 0);
}

TEST(BoundedFirstPassage, IsHeard) {
  const Chain chain = sparse_chain({states, 1, 0, 1, 1e-3, 0});
  int calls = 0;
  EXPECT_THROW(bounded_first_passage(chain,
                                     [&] {
                                       if (++calls == 5) throw std::runtime_error("enough");
                                     }),
               std::runtime_error);
  EXPECT_EQ(calls, 5);
}

TEST(BoundedFirstPassage, IteratesWhereFactorsLeaveTheMemory) {
  // Factors of 500 states that fill in take some 3.6 MB, iterating them 2 MB.
  const Chain chain = sparse_chain({500, 1, 0, 1, 1e-3, 0});
  const Generator generator = generator_of(chain);
  EXPECT_TRUE(eliminated(generator, 1e7));
  EXPECT_FALSE(eliminated(generator, 1e6));
  const BoundedSteps all = bounded_first_passage(chain), little = bounded_first_passage(chain, Heard([] {}, 0));
  EXPECT_TRUE(GeneratorSolver(generator, Heard([] {}, 1e7)).visits().empty());
  EXPECT_FALSE(GeneratorSolver(generator, Heard([] {}, 1e6)).visits().empty());
  for (std::size_t i = 0; i < chain.size(); ++i) ASSERT_NEAR(little.mean[i] / all.mean[i], 1, 1e-9) << i;
  EXPECT_GE(bounded_quasi_stationary(chain, Heard([] {}, 0)).rate_upper, bounded_quasi_stationary(chain).rate_lower);
}

/// Returns how often work was heard of before it was ended at the given call.
template <typename Work>
int heard_until(int call, Work&& work) {
  int calls = 0;
  EXPECT_THROW(work([&] {
                 if (++calls == call) throw std::runtime_error("enough");
               }),
               std::runtime_error);
  return calls;
}

// 600 states that fill in take some 7e7 multiply-adds.
TEST(BoundedFirstPassage, IsHeardDuringElimination) {
  const Chain one = sparse_chain({600, 1, 0, 1, 1e-3, 0});
  EXPECT_EQ(heard_until(3, [&](const Heard& heard) { GeneratorFactors(generator_of(one), heard); }), 3);
  EXPECT_EQ(heard_until(3, [&](const Heard& heard) { stationary_vector(generator_of(one), heard); }), 3);
  EXPECT_EQ(heard_until(8, [&](const Heard& heard) { bounded_quasi_stationary(one, heard); }), 8);
  EXPECT_EQ(heard_until(3, [&](const Heard& heard) { bounded_first_passage(one, heard); }), 3);
}

}  // namespace
}  // namespace metastable::markov
