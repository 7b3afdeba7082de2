#pragma once
// Brings what meshes of several sizes and shifts say to the spacing zero, with the errors that they show.

#include <span>
#include <vector>

namespace metastable::markov {

/// Holds a value at the spacing zero.
struct Extrapolated {
  double value = 0;
  double shift_error = 0;           ///< half of the 95 % t-interval over the shifts
  double discretization_error = 0;  ///< of the mean over the shifts, as far as the sizes show it
};

/// Holds a number with its 95 % interval.
struct MeshEstimate {
  double value = 0, lower = 0, upper = 0;
  friend bool operator==(const MeshEstimate&, const MeshEstimate&) = default;
};

/// Returns the number of which this is the logarithm.
MeshEstimate estimate_of(const Extrapolated& logarithm);

/// Extrapolates values that are polynomials in the square of the spacing h, whose square halves from each size to the
/// next; each shift by itself.
/// @param values  [shift][size], at least two shifts, all of the same two sizes or more
Extrapolated extrapolate_sizes(std::span<const std::vector<double>> values);

}  // namespace metastable::markov
