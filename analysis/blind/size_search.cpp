#include "analysis/blind/size_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace metastable::analysis {

double find_size(double start, double largest, double target, const std::function<double(double)>& power) {
  double size = std::min(start * std::sqrt(target / 16), largest);
  double low = 0, high = largest, exponent = 2;
  double last_size = 0, last_power = 0, best = size, nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 10; ++i) {
    const double now = power(size), off = std::abs(std::log(std::max(now, 1e-9) / target));
    if (off < nearest) nearest = off, best = size;
    if (std::abs(now / target - 1) < 0.1) break;
    if (size > last_size && now < 0.8 * last_power) {
      high = size;
      size = (low + high) / 2;
      continue;
    }
    if (now < target && size == largest) break;
    (now < target ? low : high) = size;
    if (now > 0 && last_power > 0 && size != last_size)
      exponent = std::clamp(std::log(now / last_power) / std::log(size / last_size), 0.7, 3.0);
    last_size = size;
    last_power = now;
    double next = now > 0.02 * target ? size * std::pow(target / now, 1 / exponent) : 3 * size;
    next = std::min(next, largest);
    if (next <= low || (next >= high && high < largest)) next = (low + high) / 2;
    size = next;
  }
  return best;
}

}  // namespace metastable::analysis
