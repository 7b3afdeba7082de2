#pragma once
// Writes numbers, and numbers with their interval, as people read them.

#include <string>

#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

enum class NumberFormat {
  significant,  ///< `digits` significant digits, trailing zeros kept: 7.020
  general,      ///< at most `digits` significant digits, trailing zeros dropped: 7.02
  fixed,        ///< `digits` decimals
  p_value,      ///< `digits` significant digits, and "< 10⁻¹²" below: chance levels are not followed further down
};

/// A number in decimals: −1.20×10⁷ is sign, mantissa "1.20" and power of ten 7.
struct Decimal {
  bool negative = false;
  bool infinite = false;
  bool less_than = false;  ///< the number is below this one
  std::string mantissa;    ///< empty: 1, not written before its power of ten
  int exponent = 0;        ///< 0: no power of ten
};

/// Unless the format is fixed, numbers below 0.001 and from 100 000 on have a power of ten.
/// @throws std::invalid_argument for NaN
Decimal to_decimal(double number, NumberFormat format, int digits);

struct DecimalEstimate {
  Decimal value, lower, upper;
};

/// Writes value and ends to the same decimals: as many as make the interval 3 to 30 units of the last one wide, and up
/// to two more where an end would else be shown as 0 that is not. Where that is not enough, as with ends that lie
/// powers of ten apart, each number has two significant digits. `format` and `digits` count where the interval has no
/// width.
/// @throws std::invalid_argument for NaN
DecimalEstimate to_decimal(const Estimate& estimate, NumberFormat format, int digits);

/// Returns "1.23×10⁷", "−0.5", "infinite", "< 10⁻¹²".
std::string plain_text(const Decimal& decimal);
/// @throws std::invalid_argument for NaN
std::string format_number(double number, NumberFormat format, int digits);

/// Returns "1.442 (1.440 to 1.444)". @throws std::invalid_argument for NaN
std::string format_estimate(const Estimate& estimate, NumberFormat format = NumberFormat::significant, int digits = 3);

/// Returns "10⁻¹²", a power of ten as plain text.
std::string power_of_ten(int exponent);

}  // namespace metastable::analysis
