#pragma once
// Finds the size at which an effect is as visible as is asked for.

#include <functional>

namespace metastable::analysis {

/// Finds the size whose power is `target`. Powers grow like a power of a small size, mostly its square: it takes secant
/// steps in logarithms, inside the bracket known so far. A large effect may stop every trial at once, which leaves no
/// power: sizes beyond one from which it falls are not looked at. Returns the size tried that came nearest.
/// @param start  has a power of about 16, or less
double find_size(double start, double largest, double target, const std::function<double(double)>& power);

}  // namespace metastable::analysis
