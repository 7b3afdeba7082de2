#include "analysis/motion_capture/savitzky_golay.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace metastable::analysis {
namespace {

// Savitzky and Golay (1964) have these tables, as corrected by Steinier, Termonia and Deltour (Anal. Chem. 44, 1972).
TEST(SavitzkyGolay, GivesThePublishedWeights) {
  const auto expect = [](const SavitzkyGolay& filter, std::vector<double> weights, double divisor) {
    const std::span<const double> found = filter.weights(filter.window() / 2);
    ASSERT_EQ(found.size(), weights.size());
    for (std::size_t i = 0; i < weights.size(); ++i) EXPECT_NEAR(found[i], weights[i] / divisor, 1e-13);
  };
  expect(SavitzkyGolay(5, 3, 0), {-3, 12, 17, 12, -3}, 35);
  expect(SavitzkyGolay(7, 3, 0), {-2, 3, 6, 7, 6, 3, -2}, 21);
  expect(SavitzkyGolay(5, 3, 1), {1, -8, 0, 8, -1}, 12);
  expect(SavitzkyGolay(7, 3, 1), {22, -67, -58, 0, 58, 67, -22}, 252);
}

TEST(SavitzkyGolay, LeavesCubicsAsTheyAreUpToTheEnds) {
  const auto cubic = [](double t) { return 1 + t * (2 + t * (-3 + t * 0.5)); };
  const auto slope = [](double t) { return 2 + t * (-6 + t * 1.5); };
  std::vector<double> values;
  for (int i = 0; i < 40; ++i) values.push_back(cubic(0.05 * i));
  for (const int window : {5, 9, 31}) {
    const std::vector<double> smooth = SavitzkyGolay(window, 3, 0).apply(values, 0.05);
    const std::vector<double> derivative = SavitzkyGolay(window, 3, 1).apply(values, 0.05);
    for (std::size_t i = 0; i < values.size(); ++i) {
      EXPECT_NEAR(smooth[i], values[i], 1e-12);
      EXPECT_NEAR(derivative[i], slope(0.05 * static_cast<double>(i)), 1e-10);
    }
  }
}

TEST(SavitzkyGolay, WideWindowsKeepTheirMoments) {
  const SavitzkyGolay filter(1001, 3, 1);
  double sum = 0, first = 0, third = 0;
  const std::span<const double> weights = filter.weights(500);
  for (int i = 0; i < 1001; ++i) {
    const double k = i - 500, w = weights[static_cast<std::size_t>(i)];
    sum += w, first += w * k, third += w * k * k * k;
  }
  EXPECT_NEAR(sum, 0, 1e-14);
  EXPECT_NEAR(first, 1, 1e-11);
  EXPECT_NEAR(third / 1e6, 0, 1e-10);
}

TEST(SavitzkyGolay, RefusesWhatHasNoFit) {
  EXPECT_THROW(SavitzkyGolay(6, 3, 1), std::invalid_argument);
  EXPECT_THROW(SavitzkyGolay(3, 3, 1), std::invalid_argument);
  EXPECT_THROW(SavitzkyGolay(5, 3, 4), std::invalid_argument);
  EXPECT_THROW(SavitzkyGolay(5, 7, 1), std::invalid_argument);
  EXPECT_THROW(SavitzkyGolay(5, 3, 1).apply(std::vector<double>(4), 1), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
