#pragma once
// Finds medians and middles of what independent rounds of splitting hold, each with a 95 % interval.

#include <cstddef>
#include <span>
#include <vector>

#include "analysis/statistics/last_moments.h"

namespace metastable::analysis {

/// Returns a share of the weight with its interval from the rounds (markov::odds_interval). NaN: not known.
/// @param inside  whether each counts, 0 to 1
/// @param ends    how many stand before the end of each round, the rounds being one after another, two or more
Estimate round_share(std::span<const double> inside, std::span<const double> weights,
                     std::span<const std::size_t> ends);

/// Returns the intervals of the median and of the ends of the middle 90 % (middle_90()): the share of the weight below
/// each has an interval from the rounds, and the quantiles of its ends are the interval (R. S. Woodruff, J. Am. Stat.
/// Assoc. 47, 635, 1952). Clones of one walk stand in the same round, so that they do not count as many. NaN where the
/// share is not known to a factor of four (markov::widest_interval).
SpreadIntervals round_quantiles(std::span<const double> values, std::span<const double> weights,
                                std::span<const std::size_t> ends);

}  // namespace metastable::analysis
