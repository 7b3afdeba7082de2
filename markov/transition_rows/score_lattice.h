#pragma once
// Puts scores of the noise on a lattice that reaches far into the tails, with their weights: never plain draws.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace metastable::markov {

/// A lattice of normal scores within a ball, moved by an offset: the sum of weight * f(scores) is E f by the
/// trapezoid rule, whose error for smooth f is far below rounding at spacings up to 0.6; over offsets spread evenly, it
/// is unbiased for any f that the ball holds.
class ScoreLattice {
 public:
  /// @param scores   how many a step, >= 1
  /// @param spacing  in (0, 1]
  /// @param reach    radius of the ball, > 0: 8.5 leaves out a probability of 2e-17 for one score
  /// @throws std::invalid_argument for values outside; std::length_error for more than some 1e7 points
  ScoreLattice(int scores, double spacing, double reach);
  std::size_t size() const { return points_.size() / scores_; }
  /// Writes scores (size() rows) and weights for an offset in [0, 1)^scores, in units of the spacing.
  void place(std::span<const double> offset, std::span<double> score, std::span<double> weight) const;

 private:
  std::size_t scores_;
  double spacing_;
  std::vector<double> points_;  ///< whole multiples of the spacing
};

/// Return four words, and as many evenly spread numbers of (0, 1), by counter (Philox): independent for other
/// arguments.
std::array<std::uint64_t, 4> random_words(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::uint64_t b);
std::array<double, 4> uniforms(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::uint64_t b);

}  // namespace metastable::markov
