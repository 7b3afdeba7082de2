#pragma once
// Follows survivors far ahead on chains that forget slowly: groups of states that are hardly ever left.

#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/generator.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {

/// Returns P(no rest within m further steps) for each m of `more`, each proven to `widest` (relative) but for the
/// bounds of the failure rate, which the quasi-stationary part takes over.
///
/// Survivors are p = a y + r with r w = 0 (y, w the quasi-stationary pair). What is left, r, is taken apart into modes
/// u_j of the Krylov space of (I - Q)^-1, r = sum u_j, so that r Q^m is about sum (1 - mu_j)^m u_j. That misses
/// D_j = (1 - mu_j) u_j - u_j Q a step, and no step makes a vector's sum of magnitudes larger: mode j errs by at most
/// |D_j| min(m, 1 / (1 - |1 - mu_j|)), or by |u_j| where it is left out. Where w > 0 a second bound holds: magnitudes
/// weighted by w, over min w, times what survives m steps at the failure rate. The smaller bound counts. Each mode
/// costs one solve.
/// @param survivors  of a chain of period 1 from every state of which rest can be reached; sum 1
/// @param more  finite
/// @throws ConvergenceError where 100 modes do not prove it
std::vector<double> survival_by_slow_modes(const Chain& chain, const QuasiStationary& quasi,
                                           std::span<const double> survivors, std::span<const double> more,
                                           double widest, const Heard& heard = {});

}  // namespace metastable::markov
