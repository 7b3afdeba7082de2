#include "markov/passage/last_steps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "markov/passage/first_passage.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

/// Solves gambler's ruin: from i (0 is one above ruin), the chance of reaching `top` first, and of ruin first.
double reaches(double i, double top, double ratio) {
  return std::expm1((i + 1) * std::log(ratio)) / std::expm1((top + 1) * std::log(ratio));
}
double fails(double i, double top, double ratio) {
  return std::pow(ratio, i + 1) * std::expm1((top - i) * std::log(ratio)) / std::expm1((top + 1) * std::log(ratio));
}

void expect_ruin(std::size_t n, std::size_t top, double up, double down) {
  const Chain chain = reference::birth_death(n, up, down, false);
  std::vector<std::uint8_t> set(n, 0);
  std::fill(set.begin() + static_cast<std::ptrdiff_t>(top), set.end(), 1);
  const PassageTo passage = passage_to(chain, set);
  const double ratio = down / up, drift = up - down;
  for (const std::size_t i : {0u, 10u, 30u}) {
    const double at = static_cast<double>(i), end = static_cast<double>(top), reach = reaches(at, end, ratio);
    EXPECT_NEAR(passage.reach[i] / reach, 1, 1e-9) << i;
    EXPECT_NEAR(passage.fail[i] / fails(at, end, ratio), 1, 1e-9) << i;
    EXPECT_NEAR(passage.steps[i] / ((reach * (end + 1) - (at + 1)) / drift), 1, 1e-7) << i;
  }
  EXPECT_EQ(passage.reach[top], 1);
  EXPECT_EQ(passage.steps[n - 1], 0);
}

TEST(PassageTo, IsTheGamblersRuinByElimination) { expect_ruin(60, 40, 0.5, 0.3); }
TEST(PassageTo, IsTheGamblersRuinByProducts) { expect_ruin(3600, 3200, 0.8, 0.1); }

// A fair walk takes a million steps, too many for products; it is cyclic besides. From i the chance of `top` is
// (i + 1) / (top + 1), and the steps are (i + 1) (top - i).
TEST(PassageByElimination, IsTheFairGamblersRuinOfAnySize) {
  const std::size_t n = 3600, top = 3500;
  const Chain chain = reference::birth_death(n, 0.5, 0.5, false);
  std::vector<std::uint8_t> set(n, 0);
  set[top] = 1;
  const PassageTo passage = passage_by_elimination(chain, set);
  for (const double i : {0.0, 1700.0, 3499.0}) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_NEAR(passage.reach[at] / ((i + 1) / 3501), 1, 1e-11) << i;
    EXPECT_NEAR(passage.fail[at] / ((3500 - i) / 3501), 1, 1e-11) << i;
    EXPECT_NEAR(passage.steps[at] / ((i + 1) * (3500 - i)), 1, 1e-11) << i;
  }
}

// 0 fails or gets to 1, 1 goes on to the set {4} or to the safe state 3; 2 is not met.
TEST(PassageTo, IsToldBesideASafeState) {
  const Chain chain({0, 1, 3, 3, 3, 3}, {1, 3, 4}, {0.5, 0.25, 0.5}, {0.5, 0.25, 1, 0, 0.5});
  const PassageTo passage = passage_to(chain, std::vector<std::uint8_t>{0, 0, 0, 0, 1});
  EXPECT_EQ(passage.reach, (std::vector<double>{0.25, 0.5, 0, 0, 1}));
  EXPECT_EQ(passage.fail, (std::vector<double>{0.625, 0.25, 1, 0, 0}));
  for (const std::size_t endless : {0u, 1u, 3u}) EXPECT_TRUE(std::isinf(passage.steps[endless])) << endless;
  EXPECT_EQ(passage.steps[2], 1);
  EXPECT_EQ(passage.steps[4], 0);
}

// The state that is left too rarely is the 4th of the chain and the 2nd outside of the set.
TEST(PassageTo, NamesTheStateOfTheChain) {
  const Chain chain({0, 0, 0, 1, 2}, {3, 2}, {0.5, 1e-320}, {0.5, 0.5, 0.25, 0});
  const std::string message = message_of<RestTooRare>([&] {
    passage_to(chain, std::vector<std::uint8_t>{1, 1, 0, 0});
  });
  EXPECT_NE(message.find("state 3 is left too rarely"), std::string::npos) << message;
}

TEST(PassageTo, KeepsTheDigitsOfWhatIsRare) {
  // Ruin is 30 states away with odds of 0.01 a step: 1e-60, and reaching is one minus nothing.
  const Chain chain = reference::birth_death(40, 0.9, 0.009, false);
  std::vector<std::uint8_t> set(40, 0);
  set[31] = 1;
  EXPECT_NEAR(passage_to(chain, set).fail[30] / fails(30, 31, 0.01), 1, 1e-12);
  EXPECT_LT(passage_to(chain, set).fail[30], 1e-60);
}

TEST(LastSteps, OfARandomChainAreWhatItsPathsSay) {
  const Chain chain = reference::random_chain(6, 5, 0.3);
  const std::vector<double> start{1, 0, 0, 0, 0, 0};
  const std::vector<double> visits = ChainSolver(chain).solve_left(start);
  const LastSteps last = last_steps(chain, visits, 3);
  ASSERT_EQ(last.share.size(), 3u);
  // By hand it goes through all walks of two steps and a failure.
  double best = 0, all = 0;
  std::vector<std::uint32_t> path;
  std::vector<double> by_first(6, 0.0);
  const auto entry = [&](std::uint32_t i, std::uint32_t j) {
    if (i == j) return chain.stay(i);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e)
      if (chain.columns(i)[e] == j) return chain.values(i)[e];
    return 0.0;
  };
  for (std::uint32_t i = 0; i < 6; ++i)
    for (std::uint32_t j = 0; j < 6; ++j)
      for (std::uint32_t k = 0; k < 6; ++k) {
        const double weight = visits[i] * entry(i, j) * entry(j, k) * chain.kill(k);
        all += weight;
        by_first[i] += weight;
        if (weight > best) {
          best = weight;
          path = {k, j, i};
        }
      }
  for (std::uint32_t i = 0; i < 6; ++i) EXPECT_NEAR(last.share[2][i], by_first[i] / all, 1e-12);
  EXPECT_EQ(last.likeliest, path);
  // All failures are told: the flux into failure of all visits is one.
  EXPECT_NEAR(std::inner_product(visits.begin(), visits.end(), chain.kill().begin(), 0.0), 1, 1e-12);
  EXPECT_NEAR(last.share[0][2], visits[2] * chain.kill(2), 1e-12);
}

TEST(LastSteps, MeasureTurnsProbabilitiesIntoDensities) {
  // State 1 is met ten times as often as state 0, being a hundred times as wide.
  const Chain chain({0, 0, 0}, {}, {}, {0.5, 0.5});
  const std::vector<double> visits{1, 10}, width{1, 100};
  EXPECT_EQ(last_steps(chain, visits, 1).likeliest.front(), 1u);
  EXPECT_EQ(last_steps(chain, visits, 1, width).likeliest.front(), 0u);
}

TEST(LastSteps, NamesWhatIsMissing) {
  const Chain chain = reference::birth_death(3, 0.5, 0.3, false);
  EXPECT_THROW(last_steps(chain, std::vector<double>{1, 1}, 2), std::invalid_argument);
  EXPECT_THROW(last_steps(chain, std::vector<double>{1, 1, 1}, 0), std::invalid_argument);
  EXPECT_THROW(last_steps(chain, std::vector<double>{0, 1, 1}, 1), std::domain_error);
  EXPECT_THROW(passage_to(chain, std::vector<std::uint8_t>{1}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
