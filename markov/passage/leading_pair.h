#pragma once
// Finds what survivors of a chain look like where plain iteration cannot tell: class by class, nothing subtracted.

#include <vector>

#include "markov/chain/generator.h"
#include "markov/chain/iterated_solver.h"

namespace metastable::markov {

/// Says that a chain has no single quasi-stationary distribution, or none that double precision tells from another.
class NotUnique : public ConvergenceError {
 public:
  /// @param one, other  states around which survivors of two kinds are
  /// @param rate   at which both fade, a step
  /// @param equal  whether the rates are exactly the same
  NotUnique(std::uint32_t one, std::uint32_t other, double rate, bool equal);
  std::uint32_t one() const { return one_; }
  std::uint32_t other() const { return other_; }
  double rate() const { return rate_; }
  bool equal() const { return equal_; }

 private:
  std::uint32_t one_, other_;
  double rate_;
  bool equal_;
};

/// Holds the smallest eigenvalue of I - Q with both eigenvectors.
struct LeadingPair {
  std::vector<Extended> left;   ///< sum 1
  std::vector<Extended> right;  ///< max 1
  Extended rate = 1;            ///< 1 - lambda_1
  int iterations = 0;
  /// Bounds the relative error of the vectors: the change of the last iteration, and what the rounding of the failure
  /// rate does where another group of states fails at nearly the same one.
  double error = 0;
};

/// Finds it for any chain, reducible and nearly decoupled ones included.
///
/// In each communicating class a common kill rate is taken off, which is exact, and Noda's iteration (Numer. Math. 17,
/// 1971) follows: with x the iterate and tau the shift below the eigenvalue, the generator X^-1 (G - tau) X is solved
/// for its expected steps w, x becomes x w, and 1 / w_i - min 1 / w are the kill rates of the next one. So shift and
/// kill rates are known relative to what is left of the rate, never to the rates within the class, and the left vector
/// follows as a stationary one. The class with the smallest rate leads; the classes after and before it follow by one
/// solve each. Costs about ten eliminations in extended precision, or iterations where GeneratorSolver prefers them.
/// @throws NotUnique where classes of equal rate lead to different vectors, or the rates of two groups of states agree
/// so closely that rounding decides between them: names a state of each
LeadingPair leading_pair(const Generator& generator, const Heard& heard = {});

}  // namespace metastable::markov
