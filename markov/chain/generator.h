#pragma once
// Eliminates the generator I - Q of a chain in extended precision, off-diagonals and kill rates apart from each other.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

using Extended = long double;

/// A function that is called about once an iteration, and every 1e7 multiply-adds of an elimination; what it throws
/// ends the work. It brings along how much memory eliminations may hold beside what iterating all states takes.
class Heard {
 public:
  Heard() = default;
  /// @param memory  [byte]
  template <typename Call>
  requires(std::is_invocable_v<Call&> && !std::is_same_v<Call, Heard>)
      Heard(Call call, double memory = std::numeric_limits<double>::infinity())
      : call_(std::move(call)), memory_(memory) {}
  explicit operator bool() const { return static_cast<bool>(call_); }
  void operator()() const { call_(); }
  double memory() const { return memory_; }

 private:
  std::function<void()> call_;
  double memory_ = std::numeric_limits<double>::infinity();
};

/// Holds I - Q, or a diagonally scaled and shifted one: row i has the off-diagonals -rate and sums to kill[i] >= 0. The
/// diagonal, exit(i), is a sum and never stored; so it keeps its digits however small it is.
struct Generator {
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<Extended> rate;
  std::vector<Extended> kill;

  std::size_t size() const { return kill.size(); }
  Extended exit(std::size_t row) const;
  /// Restricts it to `states` (ascending); what leaves them is added to the kill rates. O(entries of their rows).
  /// @param scratch  size n, all `outside`, and left so
  Generator restricted_to(std::span<const std::uint32_t> states, std::vector<std::uint32_t>& scratch) const;
  static constexpr std::uint32_t outside = 0xffffffffU;
};

/// Takes the entries of a chain that is not interpolated.
Generator generator_of(const Chain& chain);

/// Factorizes a generator without a subtraction, as Elimination does in double precision. Costs O(n b^2) for bandwidth
/// b, O(n^3) for full rows, about ten times Elimination.
class GeneratorFactors {
 public:
  /// @throws RestTooRare naming the state where a rate of leaving is zero
  explicit GeneratorFactors(const Generator& generator, const Heard& heard = {});
  /// Solves (I - Q) x = rhs, entries >= 0.
  std::vector<Extended> solve(std::span<const Extended> rhs) const;
  /// Solves y (I - Q) = rhs (row vectors), entries >= 0.
  std::vector<Extended> solve_left(std::span<const Extended> rhs) const;

 private:
  friend std::vector<Extended> stationary_vector(Generator generator, const Heard& heard);
  GeneratorFactors(const Generator& generator, bool closed, const Heard& heard);
  Extended* row(std::size_t i) { return entries_.data() + offset_[i] - low_[i]; }
  const Extended* row(std::size_t i) const { return entries_.data() + offset_[i] - low_[i]; }

  std::vector<std::size_t> low_, high_, offset_;
  std::vector<Extended> entries_, exit_;
};

/// Returns the stationary distribution of an irreducible generator, its kill rates left out; sums to one.
std::vector<Extended> stationary_vector(Generator generator, const Heard& heard = {});

/// Returns the communicating classes of a chain, the states of each ascending, in an order in which every transition
/// stays in its class or leads to a later one. O(entries).
std::vector<std::vector<std::uint32_t>> communicating_classes(const Generator& generator);

}  // namespace metastable::markov
