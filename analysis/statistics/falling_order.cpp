#include "analysis/statistics/falling_order.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace metastable::analysis {

std::vector<std::size_t> falling_order(const std::vector<double>& values) {
  constexpr double rounding = 1e-9;
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] > values[b]; });
  for (auto first = order.begin(); first != order.end();) {
    const double largest = values[*first], least = largest - rounding * std::abs(largest);
    const auto last = std::find_if(first + 1, order.end(),
                                   [&](std::size_t i) { return values[i] != largest && !(values[i] >= least); });
    std::sort(first, last);
    first = last;
  }
  return order;
}

}  // namespace metastable::analysis
