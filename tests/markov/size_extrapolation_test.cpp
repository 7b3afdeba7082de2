// Values at the spacing zero, and their errors, against polynomials and tables.

#include "markov/size_extrapolation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace metastable::markov {
namespace {

// Returns c + b h^2 + a h^4 at so many sizes, the first of h = 1.
std::vector<double> polynomial(double c, double b, double a, int sizes) {
  std::vector<double> values;
  for (double square = 1; sizes-- > 0; square /= 2) values.push_back(c + b * square + a * square * square);
  return values;
}

TEST(SizeExtrapolation, PolynomialsThatTheSizesBearAreExact) {
  for (const int sizes : {3, 4}) {
    const std::vector<std::vector<double>> values{polynomial(2, -0.3, 0.1, sizes), polynomial(2, 0.5, -0.2, sizes)};
    const Extrapolated e = extrapolate_sizes(values);
    EXPECT_NEAR(e.value, 2, 1e-12);
    EXPECT_NEAR(e.shift_error, 0, 1e-11);
  }
}

// Three shifts of which the first and the last lie 0.1 off the mean: their sd is 0.1, Student's t of two degrees of
// freedom 4.3027.
TEST(SizeExtrapolation, ShiftsThatScatterHaveTheirTInterval) {
  const std::vector<std::vector<double>> values{polynomial(0.9, 0.2, 0, 3), polynomial(1, -0.1, 0, 3),
                                                polynomial(1.1, 0, 0, 3)};
  const Extrapolated e = extrapolate_sizes(values);
  EXPECT_NEAR(e.value, 1, 1e-12);
  EXPECT_NEAR(e.shift_error, 4.3027 * 0.1 / std::sqrt(3.0), 1e-5);
}

// Three sizes cannot take out a term in h^6: the error must hold what remains of it. A term in h^2 alone is taken out,
// and the error is then that of rounding.
TEST(SizeExtrapolation, ErrorsHoldWhatTheSizesDoNotBear) {
  std::vector<double> values = polynomial(1, 0.1, 0.1, 3);
  for (std::size_t i = 0; i < 3; ++i) values[i] += 0.05 * std::pow(0.125, static_cast<double>(i));
  const Extrapolated e = extrapolate_sizes(std::vector{values, values});
  EXPECT_GT(std::abs(e.value - 1), 1e-3);
  EXPECT_LT(std::abs(e.value - 1), e.discretization_error);
  EXPECT_LT(e.discretization_error, 0.05);
  const Extrapolated straight = extrapolate_sizes(std::vector{polynomial(1, 0.1, 0, 3), polynomial(1, 0.1, 0, 3)});
  EXPECT_LT(straight.discretization_error, 1e-12);
}

}  // namespace
}  // namespace metastable::markov
