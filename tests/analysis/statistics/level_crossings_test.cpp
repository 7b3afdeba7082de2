#include "analysis/statistics/level_crossings.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace metastable::analysis {
namespace {

// Makes a curve that is known to `half` on either side.
Curve known_to(double half, double (*height)(double)) {
  return [half, height](double at, int) {
    return CurvePoint{at, {height(at), height(at) - half, height(at) + half}, ""};
  };
}

TEST(LevelCrossings, OfALineAreClosedForms) {
  const Crossings found = level_crossings(known_to(0.2, [](double x) { return 2 * x - 3; }), 0, 10, {});
  ASSERT_EQ(found.crossings.size(), 1U);
  const Crossing& one = found.crossings.front();
  EXPECT_TRUE(one.rising);
  EXPECT_NEAR(one.at.value, 1.5, 1e-3);
  EXPECT_NEAR(one.at.lower, 1.4, 2e-3);
  EXPECT_NEAR(one.at.upper, 1.6, 2e-3);
  EXPECT_FALSE(one.open_below || one.open_above);
  EXPECT_EQ(found.scanned.size(), 17U);
  EXPECT_EQ(found.scanned.back().at, 10);
}

TEST(LevelCrossings, OfACurveWithoutAnIntervalHaveNone) {
  const Crossings found = level_crossings(known_to(0, [](double x) { return std::exp(x) - 3; }), -2, 2, {});
  ASSERT_EQ(found.crossings.size(), 1U);
  EXPECT_NEAR(found.crossings.front().at.value, std::log(3.0), 1e-6);
  EXPECT_NEAR(found.crossings.front().at.upper - found.crossings.front().at.lower, 0, 1e-5);
}

TEST(LevelCrossings, AreAllThatThePointsShow) {
  const Crossings found = level_crossings(known_to(0.01, [](double x) { return std::sin(x); }), 1, 10, {});
  ASSERT_EQ(found.crossings.size(), 3U);
  for (int k = 0; k < 3; ++k) {
    const Crossing& one = found.crossings[static_cast<std::size_t>(k)];
    EXPECT_NEAR(one.at.value, (k + 1) * std::acos(-1.0), 1e-3);
    EXPECT_EQ(one.rising, k == 1);
    EXPECT_NEAR(one.at.upper - one.at.lower, 0.02, 1e-3);
  }
}

// From no point is it above zero; it turns between two of them.
TEST(LevelCrossings, AreSoughtWhereTheCurveTurnsTowardsZero) {
  const Curve hump = known_to(1e-4, [](double x) { return 0.05 - (x - 0.53) * (x - 0.53); });
  const Crossings found = level_crossings(hump, 0, 1.5, {.points = 4});
  ASSERT_EQ(found.crossings.size(), 2U);
  EXPECT_NEAR(found.crossings[0].at.value, 0.53 - std::sqrt(0.05), 1e-3);
  EXPECT_NEAR(found.crossings[1].at.value, 0.53 + std::sqrt(0.05), 1e-3);
  const Curve low = known_to(1e-4, [](double x) { return -0.01 - (x - 0.53) * (x - 0.53); });
  EXPECT_TRUE(level_crossings(low, 0, 1.5, {.points = 4}).crossings.empty());
}

TEST(LevelCrossings, SayWhereTheIntervalLeavesTheRange) {
  const Crossings found = level_crossings(known_to(1, [](double x) { return x - 0.5; }), 0, 3, {});
  ASSERT_EQ(found.crossings.size(), 1U);
  EXPECT_TRUE(found.crossings.front().open_below);
  EXPECT_EQ(found.crossings.front().at.lower, 0);
  EXPECT_FALSE(found.crossings.front().open_above);
  EXPECT_NEAR(found.crossings.front().at.upper, 1.5, 0.03);
}

TEST(LevelCrossings, TakeJumpsAndInfiniteHeights) {
  const Curve jump = [](double x, int) {
    constexpr double infinite = std::numeric_limits<double>::infinity();
    return x < 0.3 ? CurvePoint{x, {-1, -1.1, -0.9}, ""} : CurvePoint{x, {infinite, infinite, infinite}, ""};
  };
  const Crossings found = level_crossings(jump, 0, 1, {});
  ASSERT_EQ(found.crossings.size(), 1U);
  EXPECT_NEAR(found.crossings.front().at.value, 0.3, 1e-5);
}

TEST(LevelCrossings, ScanEvenlyInTheLogarithmWhereAsked) {
  const Crossings found = level_crossings(known_to(0.1, [](double x) { return std::log(x) - 2; }), 1e-3, 1e3,
                                          {.points = 7, .logarithmic = true});
  EXPECT_NEAR(found.scanned[1].at, 1e-2, 1e-12);
  ASSERT_EQ(found.crossings.size(), 1U);
  EXPECT_NEAR(std::log(found.crossings.front().at.lower), 1.9, 3e-3);
  EXPECT_NEAR(std::log(found.crossings.front().at.upper), 2.1, 3e-3);
}

TEST(LevelCrossings, LeaveOutWhatIsUnknownAndFailBetween) {
  const auto unknown_near = [](double from, double to) {
    return [from, to](double x, int) {
      return x > from && x < to ? CurvePoint{x, {}, "no answer here"}
                                : CurvePoint{x, {x - 0.5, x - 0.51, x - 0.49}, ""};
    };
  };
  EXPECT_EQ(level_crossings(unknown_near(0.8, 0.9), 0, 1, {}).crossings.size(), 1U);
  EXPECT_FALSE(level_crossings(unknown_near(0.8, 0.9), 0, 1, {}).scanned[13].unknown.empty());
  EXPECT_THROW(level_crossings(unknown_near(0.4, 0.6), 0, 1, {}), std::runtime_error);
}

TEST(LevelCrossings, AreTheSameOnAnyNumberOfThreads) {
  const Curve curve = known_to(0.2, [](double x) { return std::cos(3 * x) + 0.1 * x; });
  const Crossings one = level_crossings(curve, 0, 5, {.threads = 1}),
                  two = level_crossings(curve, 0, 5, {.threads = 2});
  ASSERT_EQ(one.crossings.size(), two.crossings.size());
  for (std::size_t i = 0; i < one.crossings.size(); ++i)
    EXPECT_EQ(one.crossings[i].at.value, two.crossings[i].at.value);
}

TEST(LevelCrossings, CountTheirLooksAndStopWhenTold) {
  std::atomic<std::size_t> looks = 0, told = 0;
  const Curve counted = [&](double x, int) {
    ++looks;
    return CurvePoint{x, {x, x - 0.01, x + 0.01}, ""};
  };
  level_crossings(counted, -1, 1.1, {.progress = [&](std::size_t n) { told = n; }});
  EXPECT_EQ(looks, told);
  EXPECT_LT(looks, 17 + 12);
  struct Stop {};
  EXPECT_THROW(level_crossings(counted, -1, 1, {.progress = [](std::size_t) { throw Stop{}; }}), Stop);
}

TEST(LevelCrossings, RefuseARangeThatIsNone) {
  const Curve curve = known_to(0, [](double x) { return x; });
  EXPECT_THROW(level_crossings(curve, 1, 1, {}), std::invalid_argument);
  EXPECT_THROW(level_crossings(curve, 0, 1, {.points = 2}), std::invalid_argument);
  EXPECT_THROW(level_crossings(curve, 0, 1, {.logarithmic = true}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
