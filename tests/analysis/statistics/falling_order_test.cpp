#include "analysis/statistics/falling_order.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace metastable::analysis {
namespace {

TEST(FallingOrder, TakesRoundingForEqual) {
  using Order = std::vector<std::size_t>;
  EXPECT_EQ(falling_order({1, 3, 2}), (Order{1, 2, 0}));
  EXPECT_EQ(falling_order({7.1, 7.1 * (1 + 1e-15), 7.2}), (Order{2, 0, 1}));
  EXPECT_EQ(falling_order({7.1 * (1 + 1e-15), 7.1, 7.2}), (Order{2, 0, 1}));
  EXPECT_EQ(falling_order({7.1, 7.1 * (1 + 1e-8)}), (Order{1, 0}));
  EXPECT_EQ(falling_order({-2, 0, -2 * (1 + 1e-15), 0}), (Order{1, 3, 0, 2}));
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(falling_order({-infinity, 1, -infinity, infinity}), (Order{3, 1, 0, 2}));
  EXPECT_EQ(falling_order({}), Order{});
}

}  // namespace
}  // namespace metastable::analysis
