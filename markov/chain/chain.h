#pragma once
// Stores an absorbing Markov chain so that nothing small is ever obtained by subtraction.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace metastable::markov {

/// A solver throws it where it did not reach its accuracy. The command line turns it into exit code 3.
class ConvergenceError : public std::runtime_error {
 public:
  /// @param residual  NaN: there is none to tell of
  ConvergenceError(std::string solver, double residual, const std::string& detail);
  const std::string& solver() const { return solver_; }
  double residual() const { return residual_; }

 protected:
  /// Takes the message of a failure that is no residual as it is.
  explicit ConvergenceError(const std::string& message) : std::runtime_error(message) {}

 private:
  std::string solver_;
  double residual_ = 0;
};

/// Represents a discrete-time absorbing chain on states 0 .. size()-1 plus one absorbing state, rest.
///
/// Row convention: row i holds the probabilities of going FROM i. Compressed sparse rows; columns ascend
/// within a row, the diagonal entry is never stored, and every stored value is > 0. The probability of
/// staying is implied: stay(i) = 1 - sum of row i - kill(i). It is never used by the subtraction-free
/// solvers, which is why off-diagonals and kill rates keep full relative accuracy (Alfa, Xue, Ye 2002,
/// "triplet representation").
class Chain {
 public:
  Chain() = default;
  /// @param row_start  size n+1; row i occupies [row_start[i], row_start[i+1])
  /// @param column, value  size row_start[n]
  /// @param kill  size n, probabilities of going to rest, >= 0
  /// @throws std::invalid_argument naming the row: a negative, NaN or infinite entry; a stored diagonal;
  ///         columns out of order or range; a row whose sum exceeds 1 by more than 1e-9.
  /// Stored zeros are dropped.
  /// @param excess  how far above 1 the sum of a row may lie, if not 1e-9 (products of chains add up their rounding)
  Chain(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column, std::vector<double> value,
        std::vector<double> kill, double excess = 1e-9);

  /// Makes a chain on the nodes of an interpolation: its entries are weights of node values, some of them negative; row
  /// sums and kill rates are probabilities all the same. Solvers take right sides of any sign then, and keep relative
  /// accuracy as long as the negative weights are few (Elimination says when they are not).
  /// @throws std::invalid_argument as the constructor does, but for negative entries
  static Chain interpolated(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column,
                            std::vector<double> value, std::vector<double> kill);

  /// Takes a dense row-major n x n matrix (its diagonal is ignored) and kill rates. Zeros are dropped.
  /// @throws std::invalid_argument as the constructor does, and when the sizes are not n * n and n.
  static Chain from_dense(std::size_t n, std::span<const double> matrix, std::span<const double> kill);

  std::size_t size() const { return kill_.size(); }
  bool interpolated() const { return interpolated_; }
  std::size_t entries() const { return value_.size(); }
  std::span<const std::uint32_t> columns(std::size_t row) const;
  std::span<const double> values(std::size_t row) const;
  double kill(std::size_t row) const { return kill_[row]; }
  std::span<const double> kill() const { return kill_; }
  /// Returns the probability of staying in `row`, max(0, 1 - row sum - kill) (of any sign if interpolated): rounded,
  /// for solvers that need it.
  double stay(std::size_t row) const;

  /// Restricts the chain to `states` (strictly ascending); what leaves them is added to the kill rates. O(entries).
  /// @throws std::invalid_argument when the states are not ascending or out of range.
  Chain restricted_to(std::span<const std::uint32_t> states) const;

 private:
  Chain(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column, std::vector<double> value,
        std::vector<double> kill, double excess, bool interpolated);

  bool interpolated_ = false;
  std::vector<std::size_t> row_start_{0};
  std::vector<std::uint32_t> column_;
  std::vector<double> value_;
  std::vector<double> kill_;
};

/// Holds the transposed pattern of a chain: the states that lead to state j are
/// row[start[j]] .. row[start[j + 1] - 1], ascending.
struct Incoming {
  std::vector<std::size_t> start;
  std::vector<std::uint32_t> row;
};
/// Transposes the pattern, O(entries).
Incoming incoming(const Chain& chain);

/// Says which states matter for coming to rest.
struct Reachability {
  std::vector<std::uint8_t> can_rest;   ///< 1: rest can be reached from the state
  std::vector<std::uint8_t> must_rest;  ///< 1: rest is reached with probability one (expected time finite)
};
/// Looks at the structure only: an entry counts however small it is. O(entries).
Reachability classify(const Chain& chain);

/// Marks with 1 every state that can be reached from those with start[i] > 0 (themselves included). O(entries).
/// @throws std::invalid_argument when `start` has not one entry per state.
std::vector<std::uint8_t> reachable_from(const Chain& chain, std::span<const double> start);

}  // namespace metastable::markov
