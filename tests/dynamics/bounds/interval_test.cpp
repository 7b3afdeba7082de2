// Every operation encloses the real result, against 50 digits.

#include "dynamics/bounds/interval.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/dynamics/normal_digits.h"

namespace metastable::dynamics {
namespace {

using test::normal_density_digits;
using test::normal_tail_digits;
using Real = boost::multiprecision::cpp_bin_float_50;

bool holds(const Interval& i, const Real& x) { return Real(i.lower) <= x && x <= Real(i.upper); }

class IntervalTest : public testing::Test {
 protected:
  double any(double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(engine_); }
  double sized() { return std::copysign(std::exp(any(-20, 20)), any(-1, 1)); }
  std::mt19937_64 engine_{1};
};

TEST_F(IntervalTest, ArithmeticEnclosesExactResults) {
  for (int k = 0; k < 20000; ++k) {
    const double a = sized(), b = sized();
    EXPECT_TRUE(holds(Interval(a) + Interval(b), Real(a) + b)) << a << " " << b;
    EXPECT_TRUE(holds(Interval(a) - Interval(b), Real(a) - b)) << a << " " << b;
    EXPECT_TRUE(holds(Interval(a) * Interval(b), Real(a) * b)) << a << " " << b;
    EXPECT_TRUE(holds(Interval(a) / Interval(b), Real(a) / b)) << a << " " << b;
    EXPECT_TRUE(holds(square(Interval(a)), Real(a) * a)) << a;
    EXPECT_TRUE(holds(sqrt(Interval(std::abs(a))), sqrt(Real(std::abs(a))))) << a;
  }
}

TEST_F(IntervalTest, WideOperandsEncloseEveryPairOfPoints) {
  for (int k = 0; k < 5000; ++k) {
    const double a = any(-3, 3), b = any(-3, 3), wa = any(0, 2), wb = any(0, 2);
    const Interval x(a, a + wa), y(b, b + wb);
    const double p = std::min(x.upper, a + wa * any(0, 1)), q = std::min(y.upper, b + wb * any(0, 1));
    EXPECT_TRUE(holds(x * y, Real(p) * q));
    EXPECT_TRUE(holds(x - y, Real(p) - q));
    EXPECT_TRUE(holds(square(x), Real(p) * p));
    EXPECT_TRUE(y.lower <= 0 || holds(x / y, Real(p) / q));
  }
}

TEST_F(IntervalTest, FunctionsOfTheCLibraryEncloseFiftyDigits) {
  for (int k = 0; k < 3000; ++k) {
    const double x = any(-600, 30), y = std::exp(any(-60, 5)), z = any(-12, 36);
    EXPECT_TRUE(holds(exp(Interval(x)), exp(Real(x)))) << x;
    EXPECT_TRUE(holds(log(Interval(y)), log(Real(y)))) << y;
    EXPECT_TRUE(holds(normal_tail(Interval(z)), normal_tail_digits(Real(z)))) << z;
    EXPECT_TRUE(holds(normal_bump(Interval(z)), normal_density_digits(Real(z)))) << z;
  }
}

TEST_F(IntervalTest, TailsThatUnderflowStayBounds) {
  const Interval tail = normal_tail(Interval(60));
  EXPECT_EQ(tail.lower, 0);
  EXPECT_GT(tail.upper, 0);
  EXPECT_LT(tail.upper, 1e-290);
}

TEST_F(IntervalTest, AnIntervalWithZeroHasNoFiniteInverse) { EXPECT_TRUE(std::isinf(inverse(Interval(-1, 1)).upper)); }

}  // namespace
}  // namespace metastable::dynamics
