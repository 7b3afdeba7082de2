#include "markov/transition_rows/draws.h"

#include <Random123/philox.h>

#include <boost/math/special_functions/erf.hpp>
#include <boost/random/sobol.hpp>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

namespace metastable::markov {
namespace {

using Philox = r123::Philox4x64;

// Words of the shift stream and of the plain random stream are told apart by the last counter word.
constexpr std::uint64_t shift_stream = 0;
constexpr std::uint64_t random_stream = 1;

std::uint64_t philox_word(const DrawOptions& options, std::uint64_t stream, std::uint64_t index, int dimension) {
  const Philox::ctr_type counter = {{index, static_cast<std::uint64_t>(dimension) / 4, options.replicate, stream}};
  const Philox::key_type key = {{options.seed, 0x6d65746173746162ULL}};
  return Philox()(counter, key)[static_cast<std::size_t>(dimension) % 4];
}

// Returns the centre of one of 2^52 equal cells: strictly inside (0, 1) and symmetric.
double unit_interval(std::uint64_t word) { return (static_cast<double>(word >> 12) + 0.5) * 0x1p-52; }

double upper_tail_score(double probability) { return std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * probability); }

struct WeightedScore {
  double score, weight;
};

// Maps v, uniform on (-1, 1), to z = a v + b v^3 and weighs it by phi(z) dz/du.
WeightedScore weighted_score(double uniform, double a, double b) {
  const double v = 2.0 * uniform - 1.0;
  const double z = v * (a + b * v * v);
  const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
  return {z, density * 2.0 * (a + 3.0 * b * v * v)};
}

}  // namespace

double normal_score(double uniform) {
  return uniform < 0.5 ? -upper_tail_score(uniform) : upper_tail_score(1.0 - uniform);
}

Draws make_draws(int noise_dimension, const DrawOptions& options) {
  if (options.count < 16) throw std::invalid_argument("samples: " + std::to_string(options.count) + " is below 16");
  if (!(options.tail >= 1e-300 && options.tail <= 1e-3))
    throw std::invalid_argument("tail: " + std::to_string(options.tail) + " is outside [1e-300, 1e-3]");
  const int dimensions = noise_dimension + 1;  // the first one places the start in its cell
  constexpr double a = 2.5;
  const double b = upper_tail_score(options.tail) - a;

  boost::random::sobol_engine<std::uint64_t, 64, boost::random::default_sobol_table> sobol(
      static_cast<std::size_t>(dimensions));
  std::vector<std::uint64_t> shift(static_cast<std::size_t>(dimensions));
  for (int d = 0; d < dimensions; ++d) shift[static_cast<std::size_t>(d)] = philox_word(options, shift_stream, 0, d);

  Draws draws;
  draws.dimension = noise_dimension;
  draws.offset.resize(options.count);
  draws.weight.resize(options.count);
  draws.score.resize(options.count * static_cast<std::size_t>(noise_dimension));
  for (std::size_t k = 0; k < options.count; ++k) {
    double weight = 1.0;
    for (int d = 0; d < dimensions; ++d) {
      const double uniform = options.sequence == Sequence::sobol
                                 ? unit_interval(sobol() ^ shift[static_cast<std::size_t>(d)])
                                 : unit_interval(philox_word(options, random_stream, k, d));
      if (d == 0) {
        draws.offset[k] = uniform;
        continue;
      }
      double& score = draws.score[k * static_cast<std::size_t>(noise_dimension) + static_cast<std::size_t>(d - 1)];
      if (options.weighting == Weighting::plain) {
        score = normal_score(uniform);
      } else {
        const WeightedScore drawn = weighted_score(uniform, a, b);
        score = drawn.score;
        weight *= drawn.weight;
      }
    }
    draws.weight[k] = weight;
  }
  const double total = std::accumulate(draws.weight.begin(), draws.weight.end(), 0.0);
  for (double& weight : draws.weight) weight /= total;
  return draws;
}

}  // namespace metastable::markov
