#pragma once
// Answers about chains that are too large to eliminate, with proven bounds.

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/generator_solver.h"
#include "markov/passage/last_steps.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {

/// The widest relative bound with which a number of this file is given; numbers with wider ones are refused.
constexpr double widest_bound = 1e-6;

/// Entry by entry, lower <= x <= upper.
struct VectorBounds {
  std::vector<double> lower, upper;
};

/// Bounds the expected steps m, (I - Q) m = 1: with v the answer and r = v - Q v, v / max r <= m <= v / min r, because
/// (I - Q)^-1 has no negative entry. It takes r in extended precision, as kill v + sum q (v_i - v_j), with the rounding
/// of that. `upper` is infinite where no bound is found. O(entries).
/// @param v  > 0
VectorBounds steps_enclosed(const Chain& chain, const SplitVector& v);

/// Returns how far v may be off by bounds that steps_enclosed() found from it, relative; the same for all entries. v
/// need not lie between them.
double error_within(const VectorBounds& bounds, const SplitVector& v);

struct BoundedSteps {
  std::vector<double> mean, sd;  ///< from each state [steps]
  VectorBounds bounds;           ///< of the mean
};
/// Finds mean and sd of the steps to rest from every state, as mean_first_passage() and first_passage_sd(), by
/// GeneratorSolver. The sd is proven by its residual: to widest_bound of itself or, where it is less than a step, of a
/// step.
/// @throws std::domain_error naming a state from which rest cannot be reached; ConvergenceError where mean or sd are
/// not proven to widest_bound
BoundedSteps bounded_first_passage(const Chain& chain, const Heard& heard = {});

/// Returns v as it is, its rest zero.
SplitVector split(std::span<const double> v);

struct BoundedQuasiStationary {
  QuasiStationary quasi;
  double rate_lower = 0,
         rate_upper = 1;  ///< of the failure rate: min and max of (w - Q w) / w, w > 0 (Collatz, Wielandt)
  /// Proven bound of the total variation between the distribution and the true one: half of the sum of absolute
  /// differences, below 1; infinite where there is none. bound_distribution() finds it.
  double distribution_error = std::numeric_limits<double>::infinity();
  /// Proven bound of the relative error of every entry of the survival weight, whose largest is 1; infinite where there
  /// is none. bound_distribution() finds it.
  double weight_error = std::numeric_limits<double>::infinity();
  std::string unproven;  ///< says why there is no bound of the distribution; empty where there is one
};
/// Bounds the failure rate by a vector: (w - Q w) / w on the states where w > 0. Bounds that are there already stay
/// where they are narrower.
///
/// The proof holds on the states where w is above 0. A reducible chain has others, which do not lead to those: its
/// bounds are proven for the class that was found to fade slowest, and not that no other class fades more slowly.
void enclose_rate(const Chain& chain, const SplitVector& weight, BoundedQuasiStationary& bounded);

/// Finds the quasi-stationary distribution of any chain by leading_pair(), cyclic chains as a whole.
/// @throws NotUnique; ConvergenceError where bounds are wider than widest_bound or the residual is above 1e-8
BoundedQuasiStationary bounded_quasi_stationary(const Chain& chain, const Heard& heard = {});

struct BoundedPassage {
  PassageTo passage;
  double error = 0;  ///< proven bound of the relative error of every entry
};
/// Finds which of a set and failure comes first, as passage_to(). For a probability v with r = v - Q v - b, |r| <= e d
/// v (d the probability of leaving), the error is at most e z with (I - Q) z >= d v: z is solved for as well, and held
/// against that.
/// @throws ConvergenceError where the bound is wider than widest_bound
BoundedPassage bounded_passage_to(const Chain& chain, std::span<const std::uint8_t> set, const Heard& heard = {});

}  // namespace metastable::markov
