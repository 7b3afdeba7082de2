#include "analysis/statistics/median.h"

#include <gtest/gtest.h>

namespace metastable::analysis {
namespace {

TEST(Median, IsTheMiddleAndOfTwoTheUpper) {
  EXPECT_EQ(median({3}), 3);
  EXPECT_EQ(median({5, 1, 3}), 3);
  EXPECT_EQ(median({4, 1, 3, 2}), 3);
}

}  // namespace
}  // namespace metastable::analysis
