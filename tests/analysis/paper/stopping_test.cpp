#include "analysis/paper/stopping.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace metastable::analysis {
namespace {

// Holds the steps of stopping_setting(), by an independent prototype's direct simulation (standard error 1.7).
constexpr double base_steps = 83.9;

TEST(Stopping, TheLegAfterTheShortestSlidesAndRestsMost) {
  const Stopping one = stopping(stopping_setting(), 100, 1, 1), two = stopping(stopping_setting(), 100, 1, 2);
  ASSERT_EQ(one.legs.size(), 8u);
  // Leg 6 of the paper's wheel lands after the shortest one, 1.6 mm shorter; leg 2 after one 1 mm longer.
  const auto slides = [](const StoppingLeg& a, const StoppingLeg& b) { return a.slides < b.slides; };
  const auto rests = [](const StoppingLeg& a, const StoppingLeg& b) { return a.rests < b.rests; };
  EXPECT_EQ(std::ranges::max_element(one.legs, slides)->leg, 6);
  EXPECT_EQ(std::ranges::min_element(one.legs, slides)->leg, 2);
  EXPECT_EQ(std::ranges::max_element(one.legs, rests)->leg, 6);
  EXPECT_NEAR(one.legs[6].longer, 0.0016, 1e-12);
  EXPECT_EQ(one.curves.front().leg, 2);
  EXPECT_EQ(one.curves.back().leg, 6);
  for (const RestingCurve& curve : one.curves) EXPECT_TRUE(std::ranges::is_sorted(curve.friction, std::greater{}));
  for (const StoppingLeg& leg : one.legs) EXPECT_LT(leg.resting, leg.sticking);
  EXPECT_EQ(one.landings(), two.landings());
  EXPECT_EQ(one.rests(), two.rests());
}

TEST(Stopping, ChangesMoveTheSteps) {
  std::size_t told = 0;
  const std::vector<DesignChange> changes = design_changes(stopping_setting(), 200, 1, 0, [&] { ++told; });
  EXPECT_EQ(told, design_change_count());
  ASSERT_EQ(changes.size(), told);
  const auto times = [&](const char* what) { return std::ranges::find(changes, what, &DesignChange::what)->times; };
  EXPECT_EQ(changes.front().times, 1);
  EXPECT_GT(times("mean of μ raised by 5 %"), 2);
  EXPECT_GT(times("sd of μ lowered by 20 %"), 2);
  EXPECT_GT(times("legs all alike"), 1);
  EXPECT_LT(changes.front().steps.lower, base_steps);
  EXPECT_GT(changes.front().steps.upper, base_steps);
  EXPECT_EQ(design_changes(stopping_setting(), 20, 1, 1).front().steps.value,
            design_changes(stopping_setting(), 20, 1, 3).front().steps.value);
}

}  // namespace
}  // namespace metastable::analysis
