#pragma once
// Holds the score that 95 % intervals of normal estimates reach to.

namespace metastable::markov {

/// The half-width of a normal estimate's 95 % interval, in standard errors: the normal's 97.5 % quantile.
inline constexpr double normal_95 = 1.959963984540054;

}  // namespace metastable::markov
