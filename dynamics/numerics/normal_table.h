#pragma once
// Reads the standard normal from a table, many values at a time: an eighth of the time of erfc and exp.

#include <cstddef>

namespace metastable::dynamics {

/// The score at which the table ends.
inline constexpr double normal_reach = 8;

/// Finds Phi(z) and the density there, to 1e-9 of either; beyond |z| = 8 they are those there, and of NaN those at -8.
/// The arrays must not overlap.
void normals_at(const double* z, std::size_t count, double* below, double* density);

}  // namespace metastable::dynamics
