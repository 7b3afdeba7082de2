#pragma once
// Squares a number.

namespace metastable::dynamics {

[[gnu::always_inline]] constexpr double square(double x) { return x * x; }

}  // namespace metastable::dynamics
