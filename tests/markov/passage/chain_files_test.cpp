#include "markov/passage/chain_files.h"

#include <gtest/gtest.h>

namespace metastable::markov {
namespace {

TEST(ChainFiles, HoldLaunchChainAndRest) {
  const double matrix[] = {0, 0.5, 0.25, 0}, kill[] = {0.25, 0.125};
  const ChainFiles files = chain_files(Chain::from_dense(2, matrix, kill), {{0.75, 0}, 0.25});
  EXPECT_EQ(files.transitions,
            "4 9\n0 1 0.75\n0 3 0.25\n1 1 0.25\n1 2 0.5\n1 3 0.25\n2 1 0.25\n2 2 0.625\n2 3 0.125\n3 3 1\n");
  EXPECT_EQ(files.labels, "0=\"init\" 1=\"deadlock\" 2=\"rest\"\n0: 0\n3: 2\n");
  EXPECT_EQ(files.rewards, "4 3\n0 1\n1 1\n2 1\n");
  EXPECT_TRUE(files.matrix_market.starts_with(
      "%%MatrixMarket matrix coordinate real general\n% state 1: launch, last state: rest\n4 4 9\n1 2 0.75\n"));
}

TEST(ChainFiles, RefuseALaunchOfAnotherSize) { EXPECT_THROW(chain_files(Chain(), {{1.0}, 0}), std::invalid_argument); }

}  // namespace
}  // namespace metastable::markov
