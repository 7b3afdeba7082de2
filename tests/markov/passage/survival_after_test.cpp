#include "markov/passage/survival_after.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "markov/passage/first_passage.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

constexpr double ever = std::numeric_limits<double>::infinity();

TEST(SurvivalAfter, OfStatesThatDoNotMeetIsThatOfEach) {
  const Chain chain = Chain::from_dense(2, std::vector<double>(4, 0.0), std::vector<double>{1e-3, 1e-6});
  const std::vector<double> steps{0, 1, 100, 5000, 1e8, 1e15, ever};
  const std::vector<double> first = survival_after(chain, std::vector<double>{1, 0}, steps),
                            either = survival_after(chain, std::vector<double>{0.5, 0.5}, steps);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const double one = std::exp(steps[k] * std::log1p(-1e-3)), other = std::exp(steps[k] * std::log1p(-1e-6));
    EXPECT_NEAR(first[k], one, 1e-11 * one) << steps[k];
    EXPECT_NEAR(either[k], (one + other) / 2, 1e-11 * (one + other)) << steps[k];
  }
}

// Half of the walkers of state 0 get to state 1, which nothing leaves.
TEST(SurvivalAfter, CountsThoseThatAreSafe) {
  const Chain chain({0, 1, 1}, {1}, {0.25}, {0.25, 0});
  for (const double n : {1.0, 2.0, 10000.0, 1e12, 1e300, ever}) {
    const double still = std::pow(0.5, std::min(n, 5000.0));
    EXPECT_NEAR(survival_after(chain, std::vector<double>{1, 0}, std::vector<double>{n})[0], 0.5 + still / 2, 1e-14)
        << n;
    EXPECT_EQ(survival_after(chain, std::vector<double>{0, 1}, std::vector<double>{n})[0], 1) << n;
  }
}

// Far out, doubling and the closed geometric tail are two ways.
TEST(SurvivalAfter, AgreesWithTheGeometricTail) {
  for (const double kill : {1e-3, 1e-9, 1e-15}) {
    const Chain chain = reference::random_chain(20, 5, kill);
    const ChainSolver solver(chain);
    std::vector<double> start(20, 0.0);
    start[3] = 1;
    const Survival tail(solver, quasi_stationary(solver), {start, 0});
    for (const double share : {0.01, 1.0, 20.0}) {
      const double n = std::floor(share / kill), expected = tail.at(n + 1);
      EXPECT_NEAR(survival_after(chain, start, std::vector<double>{n})[0] / expected, 1, 1e-9) << kill << " " << n;
    }
  }
  const Chain large = reference::random_chain(600, 5, 1e-9);
  std::vector<double> start(600, 0.0);
  start[3] = 1;
  const ChainSolver solver(large);
  EXPECT_NEAR(survival_after(large, start, std::vector<double>{1e9})[0],
              Survival(solver, quasi_stationary(solver), {start, 0}).at(1e9 + 1), 1e-12);
}

TEST(SurvivalAfter, IllegalInputs) {
  const Chain chain = reference::random_chain(2, 1, 0.1);
  const auto message = [&](const std::vector<double>& start, const std::vector<double>& steps) {
    return message_of<std::invalid_argument>([&] { survival_after(chain, start, steps); });
  };
  EXPECT_EQ(message({1}, {1}), "start: 1 probabilities given for 2 states");
  EXPECT_EQ(message({0.5, 0.4}, {1}), "start: probabilities sum to 0.9, 1 expected");
  EXPECT_EQ(message({1.5, -0.5}, {1}), "start: -0.5 for state 1 is below 0");
  EXPECT_EQ(message({1, 0}, {-1}), "steps: -1 is no whole number from 0 on, nor infinity");
  EXPECT_EQ(message({1, 0}, {1.5}), "steps: 1.5 is no whole number from 0 on, nor infinity");
  EXPECT_EQ(message({1, 0}, {std::nan("")}), "steps: nan is no whole number from 0 on, nor infinity");
}

}  // namespace
}  // namespace metastable::markov
