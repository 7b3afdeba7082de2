// Checks numbers rounded to what their interval knows.

#include "analysis/statistics/number_text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

namespace metastable::analysis {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(NumberText, ValueAndEndsHaveTheDecimalsThatTheIntervalKnows) {
  EXPECT_EQ(format_estimate({1.442, 1.44, 1.444}), "1.442 (1.440 to 1.444)");
  EXPECT_EQ(format_estimate({4.2561234, 4.2537, 4.2584}), "4.256 (4.254 to 4.258)");
  EXPECT_EQ(format_estimate({1.13, 1.11, 1.16}), "1.13 (1.11 to 1.16)");
  EXPECT_EQ(format_estimate({176.4, 111.2, 298.3}), "180 (110 to 300)");
  EXPECT_EQ(format_estimate({9.98, 9.95, 10.01}), "9.98 (9.95 to 10.01)");
  EXPECT_EQ(format_estimate({-0.0033, -0.011, 0.004}), "−0.003 (−0.011 to 0.004)");
  EXPECT_EQ(format_estimate({137, -141, 142}), "140 (−140 to 140)");
}

TEST(NumberText, OnePowerOfTenForAll) {
  EXPECT_EQ(format_estimate({1234567, 1.2e6, 1.3e6}), "1.23×10⁶ (1.20×10⁶ to 1.30×10⁶)");
  EXPECT_EQ(format_estimate({9.9e5, 9.7e5, 1.01e6}), "9.9×10⁵ (9.7×10⁵ to 10.1×10⁵)");
  EXPECT_EQ(format_estimate({2.5e-7, 2.2e-7, 2.8e-7}), "2.5×10⁻⁷ (2.2×10⁻⁷ to 2.8×10⁻⁷)");
  EXPECT_EQ(format_estimate({250000, 220000, 280000}, NumberFormat::fixed, 1), "250000 (220000 to 280000)");
}

// An interval that excludes zero never looks as if it held it.
TEST(NumberText, AnEndIsNotRoundedToZero) {
  EXPECT_EQ(format_estimate({0.3, 0.04, 0.5}), "0.30 (0.04 to 0.50)");
  EXPECT_EQ(format_estimate({0.3, 0.0, 0.5}), "0.3 (0.0 to 0.5)");
  EXPECT_EQ(format_estimate({0.004, 1e-5, 2}), "0.0040 (1.0×10⁻⁵ to 2.0)");
  EXPECT_EQ(format_estimate({3e7, 12, 8e12}), "3.0×10⁷ (12 to 8.0×10¹²)");
}

TEST(NumberText, WithoutWidthOrEnd) {
  EXPECT_EQ(format_estimate({4.25, 4.25, 4.25}), "4.25 (4.25 to 4.25)");
  EXPECT_EQ(format_estimate({4.25, 4.25, 4.25}, NumberFormat::fixed, 1), "4.2 (4.2 to 4.2)");
  EXPECT_EQ(format_estimate({226, 154, infinity}), "230 (150 to infinite)");
  EXPECT_EQ(format_estimate({infinity, 40, infinity}), "infinite (40.0 to infinite)");
  EXPECT_THROW(format_estimate({std::nan(""), 0, 1}), std::invalid_argument);
  EXPECT_THROW(format_estimate({0, std::nan(""), 1}), std::invalid_argument);
}

double number_of(const Decimal& d) {
  return (d.negative ? -1 : 1) * std::stod(d.mantissa) * std::pow(10.0, d.exponent);
}

std::size_t decimals_of(const Decimal& d) {
  const std::size_t point = d.mantissa.find('.');
  return point == std::string::npos ? 0 : d.mantissa.size() - point - 1;
}

// This holds for intervals of any size and place: rounding moves no number by more than a sixth of the width, and value
// and ends have the same decimals and power of ten.
TEST(NumberText, RoundingStaysWithinWhatTheIntervalKnows) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> exponent(-12, 12), relative(-3, 0.3), side(0, 1);
  for (int k = 0; k < 5000; ++k) {
    const double value = (side(random) < 0.3 ? -1 : 1) * std::pow(10.0, exponent(random));
    const double width = std::abs(value) * std::pow(10.0, relative(random)), below = side(random);
    const Estimate e{value, value - below * width, value + (1 - below) * width};
    if (std::min(std::abs(e.lower), std::abs(e.upper)) < width / 100) continue;  // see AnEndIsNotRoundedToZero
    const DecimalEstimate shown = to_decimal(e, NumberFormat::significant, 3);
    const auto off = [](const Decimal& d, double number) { return std::abs(number_of(d) - number); };
    const std::string text = format_estimate(e);
    ASSERT_LE(off(shown.value, e.value), width / 5.9) << text;
    ASSERT_LE(off(shown.lower, e.lower), width / 5.9) << text;
    ASSERT_LE(off(shown.upper, e.upper), width / 5.9) << text;
    ASSERT_EQ(shown.value.exponent, shown.upper.exponent) << text;
    ASSERT_EQ(shown.value.exponent, shown.lower.exponent) << text;
    ASSERT_EQ(decimals_of(shown.value), decimals_of(shown.upper)) << text;
    ASSERT_EQ(decimals_of(shown.value), decimals_of(shown.lower)) << text;
  }
}

TEST(NumberText, ChanceLevelsHaveOneFloor) {
  EXPECT_EQ(format_number(1e-23, NumberFormat::p_value, 2), "< 10⁻¹²");
  EXPECT_EQ(format_number(0, NumberFormat::p_value, 2), "< 10⁻¹²");
  EXPECT_EQ(format_number(1e-12, NumberFormat::p_value, 2), "1.0×10⁻¹²");
  EXPECT_EQ(format_number(0.0312, NumberFormat::p_value, 2), "0.031");
}

}  // namespace
}  // namespace metastable::analysis
