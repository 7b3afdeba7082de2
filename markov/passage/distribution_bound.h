#pragma once
// Bounds how far a quasi-stationary distribution and a survival weight that were found lie from the true ones.

#include <span>

#include "markov/chain/chain.h"
#include "markov/chain/envelope.h"
#include "markov/chain/generator.h"
#include "markov/passage/bounded_passage.h"

namespace metastable::markov {

/// Sets `distribution_error` (or `unproven`) and `weight_error` of what was found, and narrows the bounds of its
/// failure rate.
///
/// With y the true vector, rate its failure rate, G = I - Q and d = left - a y, a such that d is zero in the most
/// visited state s: d (G - rate) = r + (shift - rate) left with r = left (G - shift), for any shift. Where a vector
/// phi > 0, zero in s, has ((G - rate) phi)_i >= g > 0 in all other states, G - rate without s is a nonsingular
/// M-matrix (Berman, Plemmons, Nonnegative Matrices in the Mathematical Sciences, 1994, chapter 6, I27), so that y is
/// unique, and sum |d| <= sum over i != s of |r_i + (shift - rate) left_i| phi_i / g, and the total variation is no
/// more than sum |d|. phi is solved for; it is about the expected steps to s of those that survive (Cho and Meyer,
/// Linear Algebra Appl. 335, 2001, compare such bounds for chains without failure). The shift is left kill / left 1,
/// and how far it is from the rate follows from left G w - rate left w = d (G w - rate w), with w = 1 and with w =
/// right, or from the bounds of the rate. The survival weight is bounded likewise, entry by entry, by a vector psi with
/// (G - rate) psi >= right.
///
/// The proof holds in floating point: r, phi and the rate are held against the rows in extended precision, with its
/// rounding. The chain's entries count as exact, and its diagonal as one less the rest of the row. No class of states
/// need lead to all others; a finite bound proves, too, that no other class fades more slowly. Corrections of `left`
/// from its residual are tried; how far they lead from what is returned counts.
///
/// Costs one elimination of the chain or its like by iteration, and some eight solutions.
/// @param left, right  eigenvectors, as near as they are known; size n, >= 0
/// @param way  Way::eliminated: in double precision, where extended precision takes more than a second
void bound_distribution(const Chain& chain, std::span<const Extended> left, std::span<const Extended> right, Way way,
                        BoundedQuasiStationary& found, const Heard& heard = {});

}  // namespace metastable::markov
