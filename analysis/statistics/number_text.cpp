#include "analysis/statistics/number_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

namespace metastable::analysis {
namespace {

constexpr std::string_view minus_sign = "−";
constexpr int smallest_p = -12;        // power of ten
constexpr double widest_in_units = 3;  // the interval is at least so many units of the last decimal wide
constexpr int more_decimals = 2;
constexpr int digits_of_an_end = 2;
constexpr int most_digits = 15;

void drop_trailing_zeros(std::string& digits) {
  if (digits.find('.') == std::string::npos) return;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
}

bool needs_power(int exponent) { return exponent < -3 || exponent >= 5; }

int exponent_of(double number) { return static_cast<int>(std::floor(std::log10(std::abs(number)))); }

void set_mantissa(Decimal& decimal, std::string text) {
  decimal.negative = text.front() == '-' && text.find_first_of("123456789") != std::string::npos;
  decimal.mantissa = text.front() == '-' ? text.substr(1) : std::move(text);
}

// Returns `number` in units of 10^exponent, rounded to a multiple of 10^unit.
Decimal rounded(double number, int exponent, int unit) {
  Decimal decimal;
  decimal.infinite = std::isinf(number);
  decimal.negative = decimal.infinite && number < 0;
  if (decimal.infinite) return decimal;
  decimal.exponent = exponent;
  const double scaled = number / std::pow(10.0, exponent);
  const int decimals = exponent - unit;
  const double step = std::pow(10.0, -decimals);
  set_mantissa(decimal, decimals >= 0 ? fmt::format("{:.{}f}", scaled, decimals)
                                      : fmt::format("{:.0f}", std::round(scaled / step) * step));
  return decimal;
}

// Returns the width; of an interval with an infinite end, twice the finite half; 0 where there is no number.
double width(const Estimate& e) {
  if (std::isnan(e.value) || std::isnan(e.lower) || std::isnan(e.upper)) return 0;
  const bool below = std::isfinite(e.lower), above = std::isfinite(e.upper);
  if (below && above) return e.upper - e.lower;
  if (!std::isfinite(e.value) || below == above) return 0;
  return 2 * std::abs(e.value - (below ? e.lower : e.upper));
}

}  // namespace

Decimal to_decimal(double number, NumberFormat format, int digits) {
  if (std::isnan(number)) throw std::invalid_argument("not a number (NaN) cannot be shown");
  Decimal decimal;
  if (std::isinf(number)) {
    decimal.infinite = true;
    decimal.negative = number < 0;
    return decimal;
  }
  if (format == NumberFormat::p_value && number < std::pow(10.0, smallest_p)) {
    decimal.less_than = true;
    decimal.exponent = smallest_p;
    return decimal;
  }
  if (number == 0 && format != NumberFormat::fixed) {
    decimal.mantissa = "0";
    return decimal;
  }
  std::string text;
  if (format == NumberFormat::fixed) {
    text = fmt::format("{:.{}f}", number, digits);
  } else {
    // The exponent after rounding decides, so that 99999 to three digits is 1.00e5.
    const std::string scientific = fmt::format("{:.{}e}", number, digits - 1);
    const std::size_t e = scientific.find('e');
    const int exponent = std::stoi(scientific.substr(e + 1));
    if (needs_power(exponent)) {
      text = scientific.substr(0, e);
      decimal.exponent = exponent;
    } else {
      double rounded = 0;
      std::from_chars(scientific.data(), scientific.data() + scientific.size(), rounded);
      text = fmt::format("{:.{}f}", rounded, std::max(0, digits - 1 - exponent));
    }
    if (format == NumberFormat::general) drop_trailing_zeros(text);
  }
  set_mantissa(decimal, std::move(text));
  return decimal;
}

DecimalEstimate to_decimal(const Estimate& e, NumberFormat format, int digits) {
  const double wide = width(e);
  if (!(wide > 0) || !std::isfinite(wide))
    return {to_decimal(e.value, format, digits), to_decimal(e.lower, format, digits),
            to_decimal(e.upper, format, digits)};
  double largest = std::abs(e.value);
  for (const double end : {e.lower, e.upper})
    if (std::isfinite(end)) largest = std::max(largest, std::abs(end));
  // A width of 3 units is to count as such however it was rounded.
  int unit = static_cast<int>(std::floor(std::log10(wide / widest_in_units) + 1e-6));
  unit = std::max(unit, exponent_of(largest) - most_digits + 1);
  const auto hidden = [&](double end) { return end != 0 && std::abs(end) < 0.5 * std::pow(10.0, unit); };
  for (int more = 0; more < more_decimals && (hidden(e.lower) || hidden(e.upper)); ++more) --unit;
  if (hidden(e.lower) || hidden(e.upper)) {
    const auto alone = [](double number) { return to_decimal(number, NumberFormat::significant, digits_of_an_end); };
    return {alone(e.value), alone(e.lower), alone(e.upper)};
  }
  const int exponent = exponent_of(std::abs(e.value) >= wide ? e.value : largest);
  const int power = format != NumberFormat::fixed && needs_power(exponent) ? std::max(exponent, unit) : 0;
  return {rounded(e.value, power, unit), rounded(e.lower, power, unit), rounded(e.upper, power, unit)};
}

std::string power_of_ten(int exponent) {
  static constexpr std::array<std::string_view, 10> digit{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = exponent < 0 ? "10⁻" : "10";
  for (const char c : std::to_string(std::abs(exponent))) text += digit[static_cast<std::size_t>(c - '0')];
  return text;
}

std::string plain_text(const Decimal& d) {
  std::string text = d.less_than ? "< " : "";
  if (d.negative) text += minus_sign;
  text += d.infinite ? "infinite" : d.mantissa;
  if (d.exponent != 0) text += (d.mantissa.empty() ? "" : "×") + power_of_ten(d.exponent);
  return text;
}

std::string format_number(double number, NumberFormat format, int digits) {
  return plain_text(to_decimal(number, format, digits));
}

std::string format_estimate(const Estimate& estimate, NumberFormat format, int digits) {
  const DecimalEstimate e = to_decimal(estimate, format, digits);
  return fmt::format("{} ({} to {})", plain_text(e.value), plain_text(e.lower), plain_text(e.upper));
}

}  // namespace metastable::analysis
