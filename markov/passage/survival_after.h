#pragma once
// Finds the probability of surviving given numbers of steps, for any chain: reducible, undecided, never at rest.

#include <span>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// @throws std::invalid_argument for what survival_after() does not take
void check_survival(const Chain& chain, std::span<const double> start, std::span<const double> steps);

/// A chain of more states is followed by bounded_survival_after().
constexpr std::size_t doubled_states = 512;

/// Returns P(no rest within n steps) for each n of `steps`, from a distribution over the states. Up to 4096 steps are
/// followed one by one, further ones by doubling the chain, whose failure probabilities are sums of products
/// throughout, O(states^3) a doubling.
/// @param start  size n, >= 0, sums to one
/// @param steps  whole numbers >= 0; infinity: that of never coming to rest
/// @throws std::invalid_argument for other arguments (interpolated chains too); for more states than doubled_states
/// also as bounded_survival_after() and quasi_stationary()
std::vector<double> survival_after(const Chain& chain, std::span<const double> start, std::span<const double> steps);

}  // namespace metastable::markov
