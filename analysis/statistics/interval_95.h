#pragma once
// Finds 95 % intervals that need no sample: of a normal estimate and of a share.

#include <cstddef>

#include "analysis/statistics/estimate.h"
#include "markov/normal_95.h"

namespace metastable::analysis {

using markov::normal_95;

/// The same of a 90 % interval.
inline constexpr double normal_90 = 1.6448536269514722;

/// Returns count/of with its exact binomial 95 % interval (Clopper and Pearson 1934). O(1).
/// @param count  <= of
/// @param of     >= 1
/// @throws std::invalid_argument for none, or for more than there are
Estimate exact_share(std::size_t count, std::size_t of);

}  // namespace metastable::analysis
