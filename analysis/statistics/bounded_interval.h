#pragma once
// Finds the interval of a mean that cannot be negative.

#include <utility>

namespace metastable::analysis {

/// Returns the ends of the 90 % interval of a mean >= 0 of which a normal estimate with standard error 1 is known,
/// after Feldman and Cousins (Phys. Rev. D 57, 3873, 1998, section IV B): one-sided for estimates up to 1.28, two-sided
/// above, never empty, and right in 90 % of cases for every mean.
/// @param estimate  any number; those below -10 count as -10
std::pair<double, double> bounded_interval(double estimate);

}  // namespace metastable::analysis
