#pragma once
// Provides elementary functions without branches, for loops that the compiler turns into vector instructions.

#include <bit>
#include <cstdint>

namespace metastable::dynamics {

/// Returns e^x for x in [-700, 0], within 2 units in the last place.
[[gnu::always_inline]] inline double vector_exp(double x) {
  constexpr double magic = 0x1.8p52;  // adding it leaves the rounded integer in the low bits
  const double shifted = x * 1.4426950408889634 + magic, count = shifted - magic;
  const double r = (x - count * 0x1.62e42fefa0000p-1) - count * 0x1.cf79abc9e3b3ap-40;
  // Taylor's polynomial is enough: |r| <= ln(2)/2 leaves 4e-17.
  double p = 1.0 / 479001600;
  p = p * r + 1.0 / 39916800;
  p = p * r + 1.0 / 3628800;
  p = p * r + 1.0 / 362880;
  p = p * r + 1.0 / 40320;
  p = p * r + 1.0 / 5040;
  p = p * r + 1.0 / 720;
  p = p * r + 1.0 / 120;
  p = p * r + 1.0 / 24;
  p = p * r + 1.0 / 6;
  p = p * r + 0.5;
  p = p * r + 1;
  p = p * r + 1;
  return p * std::bit_cast<double>((std::bit_cast<std::int64_t>(shifted) + 1023) << 52);
}

/// Returns ln x for normal x > 0, within 2 units in the last place of max(1, |ln x|).
[[gnu::always_inline]] inline double vector_log(double x) {
  const auto bits = std::bit_cast<std::int64_t>(x);
  const std::int64_t offset = bits - std::bit_cast<std::int64_t>(0.70710678118654752);
  const std::int64_t biased = (offset + (std::int64_t{1023} << 52)) >> 52;  // exponent + 1023, >= 0
  const double m = std::bit_cast<double>(bits - ((biased - 1023) << 52));   // in [sqrt(1/2), sqrt(2))
  const double exponent = std::bit_cast<double>(biased | 0x4330000000000000) - (0x1p52 + 1023);
  const double f = m - 1, s = f / (2 + f), z = s * s;  // ln m = 2 artanh s, |s| <= 0.172
  double p = 1.0 / 19;
  p = p * z + 1.0 / 17;
  p = p * z + 1.0 / 15;
  p = p * z + 1.0 / 13;
  p = p * z + 1.0 / 11;
  p = p * z + 1.0 / 9;
  p = p * z + 1.0 / 7;
  p = p * z + 1.0 / 5;
  p = p * z + 1.0 / 3;
  return exponent * 0.69314718055994531 + (2 * s + 2 * s * z * p);
}

}  // namespace metastable::dynamics
