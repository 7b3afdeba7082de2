#pragma once
// Orders numbers that may be equal up to rounding.

#include <cstddef>
#include <vector>

namespace metastable::analysis {

/// Returns the indices of `values` by falling value; of values that agree to a relative 1e-9 the first comes first. Two
/// cells of the same events, or two variants that act alike, are equal up to rounding, which differs from processor to
/// processor: their order must not.
std::vector<std::size_t> falling_order(const std::vector<double>& values);

}  // namespace metastable::analysis
