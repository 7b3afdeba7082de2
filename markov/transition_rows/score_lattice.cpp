#include "markov/transition_rows/score_lattice.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::markov {
namespace {

constexpr double most_points = 1e7;  // A mesh asks the map at all of them for every node.

// Returns the volume of the ball in units of the spacing, about as many points as it holds.
double foreseen_points(int scores, double in_spacings) {
  const double half = 0.5 * scores;
  return std::exp(half * std::log(std::numbers::pi) - std::lgamma(half + 1) + scores * std::log(in_spacings));
}

}  // namespace

ScoreLattice::ScoreLattice(int scores, double spacing, double reach)
    : scores_(static_cast<std::size_t>(scores)), spacing_(spacing) {
  if (scores < 1) throw std::invalid_argument(fmt::format("lattice: {} scores, 1 or more expected", scores));
  if (!(spacing > 0 && spacing <= 1) || !(reach > 0))
    throw std::invalid_argument(
        fmt::format("lattice: spacing {} outside (0, 1] or reach {} not positive", spacing, reach));
  if (const double foreseen = foreseen_points(scores, reach / spacing); foreseen > most_points)
    throw std::length_error(
        fmt::format("a lattice over {} of the noises would hold about {:.1g} points for every state, {:.0g} are "
                    "allowed; splitting by "
                    "a learnt level takes any number of noises",
                    scores, foreseen, most_points));
  const int most = static_cast<int>(std::ceil(reach / spacing));
  std::vector<int> at(scores_, -most);
  for (;;) {
    double squared = 0;
    for (const int k : at) squared += (k * spacing) * (k * spacing);
    if (squared <= reach * reach)
      for (const int k : at) points_.push_back(k * spacing);
    std::size_t axis = 0;
    while (axis < scores_ && ++at[axis] > most) at[axis++] = -most;
    if (axis == scores_) return;
  }
}

void ScoreLattice::place(std::span<const double> offset, std::span<double> score, std::span<double> weight) const {
  const double unit = spacing_ / std::sqrt(2 * std::numbers::pi);
  for (std::size_t i = 0; i < size(); ++i) {
    weight[i] = 1;
    for (std::size_t k = 0; k < scores_; ++k) {
      const double z = points_[i * scores_ + k] + (offset[k] - 0.5) * spacing_;
      score[i * scores_ + k] = z;
      weight[i] *= unit * std::exp(-0.5 * z * z);
    }
  }
}

std::array<std::uint64_t, 4> random_words(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::uint64_t b) {
  const r123::Philox4x64::ctr_type counter = {{a, b, stream, 0}};
  const r123::Philox4x64::key_type key = {{seed, 0x6d657368ULL}};
  const auto words = r123::Philox4x64()(counter, key);
  return {words[0], words[1], words[2], words[3]};
}

std::array<double, 4> uniforms(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::uint64_t b) {
  std::array<double, 4> u{};
  const auto words = random_words(seed, stream, a, b);
  for (std::size_t k = 0; k < 4; ++k) u[k] = (static_cast<double>(words[k] >> 12) + 0.5) * 0x1p-52;
  return u;
}

}  // namespace metastable::markov
