#include "analysis/walkers/round_quantiles.h"

#include <cmath>

#include "analysis/statistics/estimate.h"
#include "markov/splitting/pooled_rounds.h"

namespace metastable::analysis {
namespace {

double odds_of(double share) { return share / (1 - share); }

}  // namespace

Estimate round_share(std::span<const double> inside, std::span<const double> weights,
                     std::span<const std::size_t> ends) {
  std::vector<double> over(ends.size(), 0), under(ends.size(), 0);
  for (std::size_t r = 0, i = 0; r < ends.size(); ++r)
    for (; i < ends[r]; ++i) over[r] += weights[i] * inside[i], under[r] += weights[i];
  const markov::RatioOfSums ratio = markov::ratio_of_sums(over, under);
  const markov::MeshEstimate found = markov::odds_interval(ratio.value, ratio.without);
  return {found.value, found.lower, found.upper};
}

SpreadIntervals round_quantiles(std::span<const double> values, std::span<const double> weights,
                                std::span<const std::size_t> ends) {
  const auto known = [&](double level) -> Estimate {
    const double value = weighted_quantile(values, weights, level);
    std::vector<double> below;
    for (const double one : values) below.push_back(one < value ? 1 : one == value ? 0.5 : 0);
    const Estimate share = round_share(below, weights, ends);
    if (!std::isfinite(share.lower)) return {value, undefined, undefined};
    // The quantile lies between values, and so the share below it a little off the level.
    const auto moved = [&](double end) {
      const double odds = odds_of(level) * odds_of(end) / odds_of(share.value);
      return weighted_quantile(values, weights, odds / (1 + odds));
    };
    return {value, moved(share.lower), moved(share.upper)};
  };
  return {known(0.5), known(0.05), known(0.95)};
}

}  // namespace metastable::analysis
