#pragma once
// Draws the noise: weighted so that the tails are covered, or plain.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace metastable::markov {

enum class Sequence { sobol, random };
enum class Weighting { weighted, plain };

struct DrawOptions {
  std::size_t count = 16384;
  std::uint64_t seed = 1;
  std::uint32_t replicate = 0;  ///< independent randomisation number
  Sequence sequence = Sequence::sobol;
  Weighting weighting = Weighting::weighted;
  /// Weighted draws reach scores whose tail probability is `tail` (each score, each side); in [1e-300, 1e-3].
  double tail = 1e-30;
};

/// Holds a weighted sample of the noise: the sum over draws of weight * f(scores) estimates E f.
struct Draws {
  int dimension = 0;           ///< scores a draw
  std::vector<double> offset;  ///< size count, uniform in (0,1): where in its cell a start lies
  std::vector<double> score;   ///< count x dimension, row-major, standard normal scores
  std::vector<double> weight;  ///< size count, > 0, sums to one (self-normalised)
  std::size_t count() const { return weight.size(); }
};

/// Returns the standard normal score of a uniform number in (0, 1).
double normal_score(double uniform);

/// Makes draws 0 .. count-1 of one randomisation. Sobol points (Boost; the zero point is skipped) get a digital
/// shift from Philox keyed by (seed, replicate); `random` takes its uniforms from Philox at counter = draw number.
///
/// Weighted: each score is z = a v + b v^3, v = 2u - 1, with a = 2.5 and a + b the score whose tail probability is
/// `tail`; its weight is phi(z) dz/du. Half of the points stay within the bulk, the others cover the tails evenly in z,
/// so a failure of probability 1e-12 is hit by per cents of the draws, each with its small weight.
/// Plain: z = quantile of u, equal weights.
/// @throws std::invalid_argument for count < 16 or a tail out of range.
Draws make_draws(int noise_dimension, const DrawOptions& options);

}  // namespace metastable::markov
