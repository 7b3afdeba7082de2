#pragma once
// Solves any absorbing chain, cyclic ones included, with non-negative right sides.

#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/elimination.h"
#include "markov/chain/period.h"

namespace metastable::markov {

/// Watches the chain once a revolution, on the states of class 0 (ascending): it has the product Q_0 Q_1 ... Q_{d-1}
/// and kill rates k_0 + Q_0 k_1 + Q_0 Q_1 k_2 + ...; for period 1 it is the chain itself.
Chain revolution_chain(const Chain& chain, const Period& period);

/// Solves (I - Q) x = b and y (I - Q) = b without a subtraction.
///
/// A chain of period d > 1 is reduced to the product over one revolution, R = Q_0 Q_1 ... Q_{d-1} on the
/// states of class 0, whose off-diagonals and kill rates are sums of products of non-negative numbers;
/// elimination then works on R and the other classes follow by substitution.
/// Cost: one Elimination on class 0, and for d > 1 the d - 1 products (dense, O(m^3) each for classes of m states,
/// unless the transitions fill less than a tenth of the blocks).
class ChainSolver {
 public:
  /// @throws std::domain_error naming a state from which rest cannot be reached.
  /// @throws ConvergenceError("elimination", ...) as Elimination does.
  /// @param threads  of the elimination of full chains; 0: all cores. The bits do not depend on it.
  explicit ChainSolver(const Chain& chain, int threads = 1);

  const Chain& chain() const { return chain_; }
  const Period& period() const { return period_; }
  /// Returns the chain on class 0 watched once a revolution, which is the chain itself when the period is 1.
  const Chain& revolution() const { return revolution_; }

  /// Solves (I - Q) x = rhs. @param rhs size n, finite entries >= 0 (otherwise std::invalid_argument). O(n^2) (dense
  /// rows).
  std::vector<double> solve(std::span<const double> rhs) const;
  /// Solves y (I - Q) = rhs (row vectors), the expected visits to every state, on the same conditions.
  std::vector<double> solve_left(std::span<const double> rhs) const;
  /// Does the same on the revolution chain (size of class 0).
  const Elimination& revolution_elimination() const { return elimination_; }

 private:
  Chain chain_;
  Period period_;
  Chain revolution_;
  Elimination elimination_;
};

/// They map x to Q x (column vectors: expectations) and y to y Q (row vectors: distributions), with the
/// implied probabilities of staying. O(entries). @throws std::invalid_argument when the size is not that of the chain.
/// Call the first as markov::apply: with a std::vector at hand the bare name finds std::apply as well.
std::vector<double> apply(const Chain& chain, std::span<const double> x);
std::vector<double> apply_left(const Chain& chain, std::span<const double> y);

}  // namespace metastable::markov
