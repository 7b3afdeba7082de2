#pragma once
// Finds the probability of surviving given numbers of steps on chains that are too large to eliminate.

#include <functional>
#include <span>
#include <vector>

#include "markov/passage/bounded_passage.h"

namespace metastable::markov {

/// Returns P(no rest within n steps) for each n of `steps`, as survival_after(). Survivors are followed by products.
/// Once what is left beside the quasi-stationary distribution moves the survival by no more than 1e-8, relative, in all
/// times to come (of a cyclic chain, or one of which some states must fail: once every share is settled to 1e-9), the
/// survival goes on at the failure rate, and errs by no more than that and the rate's bounds say. Where survivors are
/// foreseen to settle only after twice the steps that are followed in any case, or have not settled after 20000,
/// survival_by_slow_modes() tells the rest, to widest_bound.
/// @param quasi  is asked for it where steps lie beyond those that are followed in any case (1e9 products of entries)
/// @throws as survival_after(); ConvergenceError as survival_by_slow_modes(), and for chains that it does not take
std::vector<double> bounded_survival_after(const Chain& chain, std::span<const double> start,
                                           std::span<const double> steps,
                                           const std::function<const QuasiStationary&()>& quasi,
                                           const Heard& heard = {});

}  // namespace metastable::markov
