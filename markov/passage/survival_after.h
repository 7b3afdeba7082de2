#pragma once
// Finds the probability of surviving given numbers of steps, for any chain: reducible, undecided, never at rest.

#include <span>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// @throws std::invalid_argument for what survival_after() does not take
void check_survival(const Chain& chain, std::span<const double> start, std::span<const double> steps);

/// Returns P(no rest within n steps) for each n of `steps`, from a distribution over the states. Up to 4096 steps are
/// followed one by one, further ones by doubling the chain, whose failure probabilities are sums of products
/// throughout, O(states^3) a doubling. On more than 512 states as many as take 2e8 products are followed, further ones
/// by Survival.
/// @param start  size n, >= 0, sums to one
/// @param steps  whole numbers >= 0; infinity: that of never coming to rest
/// @throws std::invalid_argument for other arguments (interpolated chains too); std::domain_error and ConvergenceError
/// as Survival and ChainSolver, for that many steps on so many states alone
std::vector<double> survival_after(const Chain& chain, std::span<const double> start, std::span<const double> steps,
                                   int threads = 1);

}  // namespace metastable::markov
