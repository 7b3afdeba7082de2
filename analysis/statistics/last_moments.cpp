#include "analysis/statistics/last_moments.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace metastable::analysis {

Estimate middle_90(std::span<const double> values, std::span<const double> weights) {
  if (values.size() != weights.size()) throw std::invalid_argument("quantiles: a weight for each value expected");
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (weights[i] > 0) order.push_back(i);
  if (order.empty()) throw std::invalid_argument("quantiles: no value has a weight");
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  double all = 0;
  for (const std::size_t i : order) all += weights[i];
  // Each value stands in the middle of its weight; straight lines between.
  const auto quantile = [&](double level) {
    double below = 0, last_at = 0, last_value = values[order.front()];
    for (const std::size_t i : order) {
      const double at = (below + 0.5 * weights[i]) / all;
      if (at >= level) {
        if (below == 0) return values[i];
        return last_value + (values[i] - last_value) * (level - last_at) / (at - last_at);
      }
      below += weights[i];
      last_at = at;
      last_value = values[i];
    }
    return last_value;
  };
  return {quantile(0.5), quantile(0.05), quantile(0.95)};
}

}  // namespace metastable::analysis
