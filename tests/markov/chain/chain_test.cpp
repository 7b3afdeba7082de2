#include "markov/chain/chain.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

TEST(Chain, KeepsRowsDropsZerosAndImpliesStaying) {
  const Chain chain({0, 2, 3, 4}, {1, 2, 0, 1}, {0.25, 0.0, 0.5, 1.0}, {0.125, 0.0, 0.0});
  ASSERT_EQ(chain.size(), 3u);
  EXPECT_EQ(chain.entries(), 3u);
  ASSERT_EQ(chain.columns(0).size(), 1u);
  EXPECT_EQ(chain.columns(0)[0], 1u);
  EXPECT_EQ(chain.values(1)[0], 0.5);
  EXPECT_EQ(chain.values(2)[0], 1.0);
  EXPECT_EQ(chain.stay(0), 0.625);
}

TEST(Chain, FromDenseIgnoresTheDiagonal) {
  const Chain chain =
      Chain::from_dense(3, std::vector<double>{9, 0.25, 0, 0.5, 9, 0.5, 0, 0, 9}, std::vector<double>{0.25, 0, 1});
  ASSERT_EQ(chain.size(), 3u);
  EXPECT_EQ(chain.entries(), 3u);
  ASSERT_EQ(chain.columns(1).size(), 2u);
  EXPECT_EQ(chain.columns(1)[1], 2u);
  EXPECT_EQ(chain.values(1)[0], 0.5);
  EXPECT_EQ(chain.kill(0), 0.25);
  EXPECT_EQ(chain.stay(0), 0.5);
  EXPECT_EQ(chain.stay(1), 0.0);
}

TEST(Chain, StayIsNeverNegative) {
  const Chain chain({0, 1, 1}, {1}, {1.0 + 5e-10}, {0, 1});
  EXPECT_EQ(chain.stay(0), 0.0);
}

TEST(Chain, IllegalInputNamesTheRow) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto error = [](std::vector<std::size_t> start, std::vector<std::uint32_t> column, std::vector<double> value,
                        std::vector<double> kill) {
    return message_of<std::invalid_argument>([&] { Chain(start, column, value, kill); });
  };
  EXPECT_EQ(error({0, 0, 1}, {0}, {-0.5}, {0, 0}), "chain row 1: an entry is -0.5, not a finite number >= 0");
  EXPECT_EQ(error({0, 0, 1}, {0}, {nan}, {0, 0}), "chain row 1: an entry is nan, not a finite number >= 0");
  EXPECT_EQ(error({0, 0, 0}, {}, {}, {0, -1}), "chain row 1: the kill rate is -1, not a finite number >= 0");
  EXPECT_EQ(error({0, 0, 1}, {1}, {0.5}, {0, 0}), "chain row 1: the diagonal must not be stored");
  EXPECT_EQ(error({0, 1, 1}, {2}, {0.5}, {0, 0}), "chain row 0: column 2 of 2 is out of range");
  EXPECT_EQ(error({0, 2, 2, 2}, {2, 1}, {0.5, 0.5}, {0, 0, 0}), "chain row 0: columns must ascend");
  EXPECT_EQ(error({0, 1, 1}, {1}, {0.75}, {0.5, 0}), "chain row 0: entries and kill rate sum to 1 + 0.25");
  EXPECT_EQ(error({0, 1}, {1}, {0.75}, {0.5, 0}),
            "chain: row_start must ascend from 0 to the number of entries, one more than rows");
  EXPECT_EQ(
      message_of<std::invalid_argument>([] { Chain::from_dense(2, std::vector<double>(3), std::vector<double>(2)); }),
      "dense chain: expected 2 x 2 entries and as many kill rates as rows");
}

TEST(Chain, RestrictionTurnsExitsIntoKills) {
  const Chain chain = reference::birth_death(5, 0.25, 0.5, false);
  const Chain part = chain.restricted_to(std::vector<std::uint32_t>{1, 2, 4});
  ASSERT_EQ(part.size(), 3u);
  EXPECT_EQ(part.kill(0), 0.5);
  EXPECT_EQ(part.kill(1), 0.25);
  EXPECT_EQ(part.kill(2), 0.5);
  EXPECT_EQ(part.columns(0)[0], 1u);
  EXPECT_EQ(part.stay(2), 0.5);
  EXPECT_EQ(message_of<std::invalid_argument>([&] {
              chain.restricted_to(std::vector<std::uint32_t>{2, 1});
            }),
            "restricted chain: states must ascend and lie below 5");
}

TEST(Chain, IncomingIsTheTransposedPattern) {
  const Chain chain({0, 1, 2, 4}, {2, 2, 0, 1}, {1, 1, 0.5, 0.5}, {0, 0, 0});
  const Incoming into = incoming(chain);
  EXPECT_EQ(into.start, (std::vector<std::size_t>{0, 1, 2, 4}));
  EXPECT_EQ(into.row, (std::vector<std::uint32_t>{2, 2, 0, 1}));
}

// The chain is 0 -> rest; 1 -> 0 or 2; 2 <-> 3 for ever; 4 -> 0; 5 -> 4.
TEST(Classify, TellsCanRestFromMustRest) {
  const Chain chain({0, 0, 2, 3, 4, 5, 6}, {0, 2, 3, 2, 0, 4}, {1e-300, 0.5, 1, 1, 1, 1}, {1e-300, 0, 0, 0, 0, 0});
  const Reachability reach = classify(chain);
  EXPECT_EQ(reach.can_rest, (std::vector<std::uint8_t>{1, 1, 0, 0, 1, 1}));
  EXPECT_EQ(reach.must_rest, (std::vector<std::uint8_t>{1, 0, 0, 0, 1, 1}));
  EXPECT_EQ(reachable_from(chain, std::vector<double>{0, 0, 0, 0, 0, 1}),
            (std::vector<std::uint8_t>{1, 0, 0, 0, 1, 1}));
  EXPECT_EQ(message_of<std::invalid_argument>([&] { reachable_from(chain, std::vector<double>(2)); }),
            "start distribution: one entry per state expected");
}

TEST(ConvergenceErrorTest, SaysWhichSolverAndHowFar) {
  const ConvergenceError error("KLU", 0.5, "why");
  EXPECT_STREQ(error.what(), "KLU did not converge: residual 0.5: why");
  EXPECT_EQ(error.solver(), "KLU");
  EXPECT_EQ(error.residual(), 0.5);
}

}  // namespace
}  // namespace metastable::markov
