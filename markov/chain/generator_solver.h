#pragma once
// Solves I - Q of any size: by elimination where that is cheap, and class by class, by iteration where it is not.

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "markov/chain/generator.h"
#include "markov/chain/iterated_solver.h"

namespace metastable::markov {

/// Says whether GeneratorFactors is to take a generator: whether its elimination takes no more than 5e9 multiply-adds
/// and 4e7 entries, some ten seconds and 0.6 GB, and no more than `memory` [byte] beside what iterating it would.
bool eliminated(const Generator& generator, double memory = std::numeric_limits<double>::infinity());

/// A vector as the sum of two, whose entries differ by less than their sum can hold.
struct SplitVector {
  std::vector<Extended> base, rest;
  Extended sum(std::size_t i) const { return base[i] + rest[i]; }
  /// Returns entry i less entry j.
  Extended difference(std::size_t i, std::size_t j) const { return (base[i] - base[j]) + (rest[i] - rest[j]); }
};

/// Holds what solving a generator takes. From every state it must be possible to leave.
class GeneratorSolver {
 public:
  /// Classes are eliminated as long as heard.memory() is left for their factors, which are held together.
  /// @param start  visits to begin iterations with, of all states, or nothing
  /// @throws RestTooRare, ConvergenceError as GeneratorFactors and IteratedSolver
  explicit GeneratorSolver(const Generator& generator, Heard heard = {}, std::span<const Extended> start = {});
  /// Solves (I - Q) x = rhs. Where it iterates, signs may be any.
  std::vector<Extended> solve(std::span<const Extended> rhs);
  SplitVector solve_split(std::span<const Extended> rhs);
  /// Solves y (I - Q) = rhs (row vectors).
  std::vector<Extended> solve_left(std::span<const Extended> rhs);
  /// Returns whether some class is iterated: entries there are right to rounding of the largest, and not each for
  /// itself.
  bool iterates() const;
  /// Returns visits to begin with for a generator of nearly the same rates; empty unless one iteration has all states.
  std::span<const Extended> visits() const;

 private:
  struct Part {
    std::vector<std::uint32_t> states;
    std::unique_ptr<GeneratorFactors> factors;
    std::unique_ptr<IteratedSolver> iterated;  ///< neither: one state
  };
  void solve_part(Part& part, std::vector<Extended>& arriving, SplitVector& x);

  Heard heard_;
  Generator generator_;
  std::unique_ptr<GeneratorFactors> whole_;
  std::vector<Part> parts_;
  std::vector<std::uint32_t> part_of_;
};

/// Returns the stationary distribution of an irreducible generator, its kill rates left out, in either way.
std::vector<Extended> stationary_distribution(const Generator& generator, const Heard& heard,
                                              std::span<const Extended> start = {});

}  // namespace metastable::markov
