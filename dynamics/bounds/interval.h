#pragma once
// Holds intervals that surely hold the real result: every bound is moved outward past its rounding error.

#include <algorithm>
#include <cmath>
#include <limits>

namespace metastable::dynamics {

/// Stands for [lower, upper], lower <= upper. Operations enclose: for real a in A and b in B, a op b lies in A op B.
///
/// Error model: double operations and sqrt round to nearest (relative error at most 2^-53, or an absolute one of the
/// smallest denormal), so moving a bound v by |v| 2^-51 + 1e-300 passes the real value. exp and log are taken to be
/// right within 4 units in the last place and erfc within 16; the GNU C library states 1, 1 and 5. The rounding mode is
/// never switched, so intervals are as fast as their handful of multiplications and safe between threads.
struct Interval {
  double lower = 0, upper = 0;
  constexpr Interval() = default;
  constexpr Interval(double value) : lower(value), upper(value) {}  // NOLINT(google-explicit-constructor)
  constexpr Interval(double from, double to) : lower(from), upper(to) {}
  double middle() const { return lower + 0.5 * (upper - lower); }
  bool contains(double x) const { return lower <= x && x <= upper; }
};

namespace rounding {
inline constexpr double unit = 0x1p-51;
inline constexpr double floor = 1e-300;
inline double down(double v, double units = 1) { return v - (std::abs(v) * (units * unit) + floor); }
inline double up(double v, double units = 1) { return v + (std::abs(v) * (units * unit) + floor); }
inline Interval outward(double lower, double upper, double units = 1) { return {down(lower, units), up(upper, units)}; }
}  // namespace rounding

/// Returns a computed constant within `relative` of the real number it stands for.
inline Interval around(double value, double relative = 0x1p-46) {
  const double r = std::abs(value) * relative;
  return {rounding::down(value - r), rounding::up(value + r)};
}
/// Returns the part two enclosures of the same number share.
inline Interval common(const Interval& a, const Interval& b) {
  return {std::max(a.lower, b.lower), std::min(a.upper, b.upper)};
}
inline Interval hull(const Interval& a, const Interval& b) {
  return {std::min(a.lower, b.lower), std::max(a.upper, b.upper)};
}
inline Interval operator-(const Interval& a) { return {-a.upper, -a.lower}; }
inline Interval operator+(const Interval& a, const Interval& b) {
  return rounding::outward(a.lower + b.lower, a.upper + b.upper);
}
inline Interval operator-(const Interval& a, const Interval& b) {
  return rounding::outward(a.lower - b.upper, a.upper - b.lower);
}
inline Interval operator*(const Interval& a, const Interval& b) {
  const double p = a.lower * b.lower, q = a.lower * b.upper, r = a.upper * b.lower, s = a.upper * b.upper;
  return rounding::outward(std::min(std::min(p, q), std::min(r, s)), std::max(std::max(p, q), std::max(r, s)));
}
/// Returns 1/a; the whole line if a holds 0.
inline Interval inverse(const Interval& a) {
  if (a.lower > 0 || a.upper < 0) return rounding::outward(1 / a.upper, 1 / a.lower);
  return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
}
inline Interval operator/(const Interval& a, const Interval& b) { return a * inverse(b); }
inline Interval& operator+=(Interval& a, const Interval& b) { return a = a + b; }
inline Interval square(const Interval& a) {
  const double p = a.lower * a.lower, q = a.upper * a.upper;
  const Interval s = rounding::outward(std::min(p, q), std::max(p, q));
  return {a.contains(0) ? 0 : std::max(0.0, s.lower), s.upper};
}
/// Encloses the square root of the part above 0.
inline Interval sqrt(const Interval& a) {
  const Interval s = rounding::outward(std::sqrt(std::max(0.0, a.lower)), std::sqrt(std::max(0.0, a.upper)));
  return {std::max(0.0, s.lower), s.upper};
}
inline Interval exp(const Interval& a) {
  const Interval e = rounding::outward(std::exp(a.lower), std::exp(a.upper), 4);
  return {std::max(0.0, e.lower), e.upper};
}
inline Interval log(const Interval& a) { return rounding::outward(std::log(a.lower), std::log(a.upper), 4); }
/// Encloses 1 - Phi(z), the upper tail of the standard normal, which falls with z.
inline Interval normal_tail(const Interval& z) {
  // The argument of erfc is rounded once more: a relative 2^-52 of it changes erfc(w) by at most 2 w^2 + 2 w times
  // that.
  constexpr double half_sqrt_two = 0.70710678118654752440;
  const auto units = [](double w) { return 16 + 4 * w * w + 4 * std::abs(w); };
  const double a = z.upper * half_sqrt_two, b = z.lower * half_sqrt_two;
  return {std::max(0.0, rounding::down(0.5 * std::erfc(a), units(std::min(std::abs(a), 40.0)))),
          std::min(1.0, rounding::up(0.5 * std::erfc(b), units(std::min(std::abs(b), 40.0))))};
}
/// Encloses the density of the standard normal.
inline Interval normal_bump(const Interval& z) {
  const Interval s = square(z);
  return exp(Interval(-0.5 * s.upper, -0.5 * s.lower)) * around(0.39894228040143267794, 0x1p-52);
}

}  // namespace metastable::dynamics
