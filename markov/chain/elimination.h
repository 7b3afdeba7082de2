#pragma once
// Eliminates an absorbing chain in triplet form without subtraction (Grassmann, Taksar, Heyman 1985);
// every entry of the answer has full relative accuracy (Alfa, Xue, Ye 2002), however rare rest is.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// Says that rest is so rare that probabilities or expected steps leave the range of double precision.
class RestTooRare : public ConvergenceError {
 public:
  using ConvergenceError::ConvergenceError;
  /// Names the state that is left so rarely.
  RestTooRare(double rate, std::size_t state);
  /// Returns the same of a chain in which the states have these numbers.
  RestTooRare in_states(std::span<const std::uint32_t> numbers) const;

 private:
  std::optional<std::size_t> state_;
};

/// Does work on some `states` of a chain; a state that an error names is named by its number in the chain.
template <typename Work>
auto on_states(std::span<const std::uint32_t> states, Work&& work) {
  try {
    return work();
  } catch (const RestTooRare& error) {
    throw error.in_states(states);
  }
}

/// Factorizes I - Q = (I - U) D (I - L) with U, L >= 0 and D > 0 without a subtraction.
///
/// Takes chains in which every state can reach rest. Costs O(n^3 / 3) multiply-adds for a full chain,
/// O(n b^2) for bandwidth b (row envelopes are stored, not the whole square); memory is the envelope. States are
/// eliminated from the last to the first, in the order given: number them so that transitions stay near the diagonal.
/// The relative error of every entry of a solution is a small multiple of n times rounding, whatever the chain.
class Elimination {
 public:
  /// @throws std::domain_error if some state cannot reach rest (names the state).
  /// @throws RestTooRare("elimination", ...) if a probability falls below the range of double precision.
  /// @param threads  for full chains; 0: all cores. The bits do not depend on it.
  explicit Elimination(const Chain& chain, int threads = 1);
  ~Elimination();
  Elimination(Elimination&&) noexcept;
  Elimination& operator=(Elimination&&) noexcept;

  std::size_t size() const;
  /// Solves (I - Q) x = rhs. @param rhs size n, every entry >= 0 (otherwise std::invalid_argument). Cost: the envelope.
  /// @throws RestTooRare("elimination", ...) if the answer exceeds the range of double precision.
  std::vector<double> solve(std::span<const double> rhs) const;
  /// Solves y (I - Q) = rhs (row vector), entries >= 0; y[i] is the expected number of visits to state i of chains
  /// started in rhs. Throws as solve() does.
  std::vector<double> solve_left(std::span<const double> rhs) const;

 private:
  struct Solver {
    virtual ~Solver() = default;
    virtual std::size_t size() const = 0;
    virtual std::vector<double> solve(std::span<const double> rhs) const = 0;
    virtual std::vector<double> solve_left(std::span<const double> rhs) const = 0;
  };
  struct Factors;   // subtraction-free
  struct Bordered;  // of interpolated chains
  std::unique_ptr<Solver> solver_;
};

}  // namespace metastable::markov
