#pragma once
// Solves a chain for answers whose entries span more decades than one solution holds.

#include <cstdint>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/generator_solver.h"

namespace metastable::markov {

/// Solves (I - Q) x = b, b >= 0, so that small entries keep their digits as well.
///
/// One solution is right to rounding of its largest entries. Where the others are smaller by more than a few decades,
/// they are solved for anew among themselves, with what leads from them to larger entries on the right side; and the
/// smallest of these once more. What small entries give back to large ones is too little to count. Elimination, which
/// never subtracts, has all digits at once.
class NestedSolver {
 public:
  /// @param whole   of the chain; both must outlive this
  /// @param reached  one entry a state: 0 where x is zero whatever b is
  NestedSolver(const Chain& chain, GeneratorSolver& whole, std::span<const std::uint8_t> reached, const Heard& heard);
  /// Solves for x >= 0. The first solution decides which entries are solved for anew, so that later ones should be
  /// large and small in the same places.
  /// @param right  >= 0, size n
  /// @throws as GeneratorSolver
  SplitVector solve(std::span<const Extended> right);

 private:
  struct Level {
    std::vector<std::uint32_t> states;
    GeneratorSolver solver;
  };
  /// Returns the states of the last level whose entries of x are small beside the largest of them.
  std::vector<std::uint32_t> small_entries(const SplitVector& x) const;
  void solve_level(Level& level, std::span<const Extended> right, SplitVector& x);

  const Chain& chain_;
  GeneratorSolver& whole_;
  Heard little_;  ///< Levels are eliminated only where that takes no more memory than iterating them.
  std::vector<std::uint32_t> reached_;
  std::vector<Level> levels_;
  bool decided_;
};

}  // namespace metastable::markov
