#pragma once
// Says how a chain fails: its last steps before failure, and which of set and failure comes first.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// Holds the last steps of walkers that fail; k = 0 is the step that fails, k = 1 the one before, and so on.
struct LastSteps {
  /// share[k][i] is the probability that step k begins in state i. Each sums to one.
  std::vector<std::vector<double>> share;
  /// fails_in[k][i] is the probability that a walker in state i fails in exactly its (k + 1)-th step from now.
  std::vector<std::vector<double>> fails_in;
  /// The most likely path: the state in which each step begins, likeliest[k] that of step k.
  std::vector<std::uint32_t> likeliest;
};

/// Tells of walkers whose states are met in proportion to `visits`: with a quasi-stationary distribution, the flux into
/// failure of the metastable regime; with the expected visits after a launch, all its failures (but for those in the
/// launch's own step). share[k] = visits * fails_in[k], fails_in[0] the kill rates, fails_in[k + 1] = Q fails_in[k]:
/// nothing is subtracted.
///
/// The path has the largest product of visits, entries and kill rate (Viterbi's algorithm), each entry divided by its
/// state's `measure` (the width of its cell; empty: all alike). O(entries) a step.
/// @param steps  >= 1; fewer are told where nobody fails so late
/// @throws std::invalid_argument for sizes that are not the chain's; std::domain_error if no state visited fails
LastSteps last_steps(const Chain& chain, std::span<const double> visits, int steps,
                     std::span<const double> measure = {});

/// Describes the first passage to a set of states, or to failure if that comes first.
struct PassageTo {
  std::vector<double> reach;  ///< committor: probability of being in the set, now or later, before failing
  std::vector<double> fail;   ///< probability of failing before that; neither is one minus the other
  std::vector<double> steps;  ///< expected steps until either; 0 in the set, infinite where neither need come
};

/// Holds what first passage to a set asks of a chain: the states that are not decided by the structure alone.
struct PassageQuestion {
  PassageTo passage;                     ///< of the others
  std::vector<std::uint32_t> undecided;  ///< ascending
  Chain inside;                          ///< on these; its kill rates lead to the set or to failure
  std::vector<double> to_set, kill;      ///< the two parts of these
  std::vector<std::uint8_t> must;        ///< whether the set or failure must come

  /// Fills in what has been solved for: (I - Q) x = to_set, kill, 1.
  void answer(std::span<const double> reach, std::span<const double> fail, std::span<const double> steps);
};

/// O(entries). @throws std::invalid_argument for a set of another size
PassageQuestion passage_question(const Chain& chain, std::span<const std::uint8_t> set);

/// Solves the chain outside of the set, by elimination up to 3000 states, beyond them by products. Where neither the
/// set nor failure can be reached, both probabilities are 0.
/// @param set  one entry a state, 1 for those of the set
/// @throws std::invalid_argument for another size; RestTooRare as Elimination; ConvergenceError if 100000 products do
///         not settle
PassageTo passage_to(const Chain& chain, std::span<const std::uint8_t> set);

/// Does the same by elimination whatever the size, for chains whose elimination is cheap: every entry is right to a
/// small multiple of n times rounding. Costs three solutions and no more than the whole chain's elimination.
/// @param threads  of the elimination of full chains; 0: all cores
/// @throws as passage_to(), but for products
PassageTo passage_by_elimination(const Chain& chain, std::span<const std::uint8_t> set, int threads = 1);

}  // namespace metastable::markov
