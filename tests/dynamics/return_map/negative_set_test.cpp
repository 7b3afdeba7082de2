#include "dynamics/return_map/negative_set.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

TEST(NegativeSet, FindsEveryPieceOfASine) {
  const std::array edges{0.5, 10.0};
  const auto found = negative_set([](double x) { return std::sin(x); }, edges, 20);
  ASSERT_EQ(found.size(), 2U);  // the second is cut by the edge
  EXPECT_NEAR(found[0].lower, std::numbers::pi, 1e-14);
  EXPECT_NEAR(found[0].upper, 2 * std::numbers::pi, 1e-14);
  EXPECT_NEAR(found[1].lower, 3 * std::numbers::pi, 1e-14);
  EXPECT_EQ(found[1].upper, 10);
}

TEST(NegativeSet, FindsAPairOfRootsBetweenSamples) {
  const std::array edges{0.0, 1.0};
  const auto found = negative_set([](double x) { return (x - 0.52) * (x - 0.52) - 1e-6; }, edges, 10);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].lower, 0.519, 1e-12);
  EXPECT_NEAR(found[0].upper, 0.521, 1e-12);
}

// The sample at the edge is the one closest to zero, and the dip lies between it and the next.
TEST(NegativeSet, FindsAPairOfRootsBesideAnEdge) {
  for (const double centre : {0.004, 0.03, 0.97, 0.996}) {
    const std::array edges{0.0, 1.0};
    const auto found = negative_set([&](double x) { return (x - centre) * (x - centre) - 1e-6; }, edges, 10);
    ASSERT_EQ(found.size(), 1U) << centre;
    EXPECT_NEAR(found[0].lower, centre - 1e-3, 1e-12);
    EXPECT_NEAR(found[0].upper, centre + 1e-3, 1e-12);
  }
}

TEST(NegativeSet, KeepsTheEdgesAsBounds) {
  const std::array edges{0.0, 0.3, 1.0};
  const auto all = negative_set([](double) { return -1.0; }, edges, 3);
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].lower, 0);
  EXPECT_EQ(all[0].upper, 1);
  EXPECT_TRUE(negative_set([](double) { return 0.0; }, edges, 3).empty());
  const auto kink = negative_set([](double x) { return std::abs(x - 0.3) - 0.1; }, edges, 8);
  ASSERT_EQ(kink.size(), 1U);
  EXPECT_NEAR(kink[0].lower, 0.2, 1e-14);
  EXPECT_NEAR(kink[0].upper, 0.4, 1e-14);
}

}  // namespace
}  // namespace metastable::dynamics
