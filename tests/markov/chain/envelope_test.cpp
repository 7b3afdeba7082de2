// Counts of what elimination takes, held against the elimination of the pattern itself.

#include "markov/chain/envelope.h"

#include <gtest/gtest.h>

#include "tests/markov/reference_chains.h"
#include "tests/markov/sparse_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

TEST(Envelope, IsThatOfEliminatingThePattern) {
  for (const std::size_t n : {1U, 2U, 30U, 60U}) {
    const Chain chain = reference::sparse_chain({n, 1, 0, 1, 0.1, 0});
    std::vector<std::size_t> low(n), high(n);
    for (std::size_t i = 0; i < n; ++i) {
      low[i] = chain.columns(i).empty() ? i : std::min<std::size_t>(i, chain.columns(i).front());
      high[i] = chain.columns(i).empty() ? i : std::max<std::size_t>(i, chain.columns(i).back());
    }
    double entries = 0, work = 0;
    for (std::size_t pivot = n; pivot-- > 0;) {
      entries += static_cast<double>(high[pivot] - low[pivot] + 1);
      for (std::size_t i = 0; i < pivot; ++i) {
        if (high[i] < pivot) continue;
        low[i] = std::min(low[i], low[pivot]);
        work += static_cast<double>(pivot - low[pivot]);
      }
    }
    EXPECT_EQ(envelope_of(chain).entries, entries);
    EXPECT_EQ(envelope_of(chain).multiply_adds, work);
  }
}

TEST(Envelope, BandsAndSmallChainsAreEliminatedAndLargeOnesThatFillAreNot) {
  EXPECT_EQ(way_of(reference::birth_death(100000, 0.3, 0.2, false), 2e9), Way::eliminated);
  EXPECT_EQ(way_of(reference::random_chain(300, 1, 0.1), 2e9), Way::eliminated);
  EXPECT_EQ(way_of(reference::sparse_chain({20000, 1, 0, 1, 0.1, 0}), 2e9), Way::iterated);
}

TEST(Envelope, SaysHowMuchMemoryWouldDo) {
  const Chain chain = reference::sparse_chain({20000, 1, 0, 1, 0.1, 0});
  EXPECT_NE(message_of<MemoryExceeded>([&] { way_of(chain, 1e6); }).find("memory_gb allows 0.001"), std::string::npos);
}

}  // namespace
}  // namespace metastable::markov
