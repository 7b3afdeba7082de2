#pragma once
// Solves a large irreducible chain by iteration where eliminating it would fill too much.

#include <memory>
#include <span>
#include <vector>

#include "markov/chain/flow_network.h"
#include "markov/chain/generator.h"

namespace metastable::markov {

class FlowCorrection;

/// Iterates for the solutions of (I - Q) x = b and y (I - Q) = b on an irreducible generator.
///
/// The rows are first weighted by the visits y of the chain without its kill rates, found to the rounding of extended
/// precision, so that as much flows into a state as out of it. Then x = c + u: c follows from the balance of all
/// losses, c sum l = sum g - sum l u, where nothing cancels however rare losses are, and u from A u = g - c l by
/// conjugate residuals (Eisenstat, Elman, Schultz, SIAM J. Numer. Anal. 20, 1983) with FlowNetwork as preconditioner:
/// these in double precision, and residuals anew in extended precision after each ten digits or so. One minus an
/// eigenvalue occurs nowhere. Costs some tens of products with the rows; it vouches for nothing: callers hold what they
/// get against the rows.
class IteratedSolver {
 public:
  /// @param start  visits to begin with, > 0, or nothing
  /// @throws ConvergenceError("balance of visits", ...) where the visits do not settle
  IteratedSolver(Generator generator, std::span<const Extended> start, Heard heard);
  ~IteratedSolver();

  /// x = base + rest, apart because their sum would round what neighbours differ by.
  struct Solution {
    Extended base = 0;
    std::vector<Extended> rest;
  };
  /// Solves (I - Q) x = rhs, any signs. Some kill rate has to be above zero.
  Solution solve(std::span<const Extended> rhs);
  /// Solves y (I - Q) = rhs (row vectors) on the same condition.
  std::vector<Extended> solve_left(std::span<const Extended> rhs);
  /// Returns the stationary distribution of the chain without its kill rates; sums to one.
  const std::vector<Extended>& visits() const { return visits_; }

 private:
  Solution solved(std::vector<Extended> right, FlowSide side);

  Generator generator_;
  Heard heard_;
  std::vector<Extended> visits_;
  int way_ = 0;  ///< of FlowCorrection, the easiest first
  std::unique_ptr<FlowCorrection> correction_;
};

}  // namespace metastable::markov
