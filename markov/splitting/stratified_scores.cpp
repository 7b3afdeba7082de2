#include "markov/splitting/stratified_scores.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr double wide_share = 0.25, width = 3;

/// Gives one uniform number of (0, 1) after another.
class Uniforms {
 public:
  Uniforms(std::uint64_t seed, std::uint64_t stream, std::uint64_t a) : seed_(seed), stream_(stream), a_(a) {}
  double next() {
    if (used_ % 4 == 0) held_ = uniforms(seed_, stream_, a_, used_ / 4);
    return held_[used_++ % 4];
  }
  std::size_t below(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(next() * static_cast<double>(count)));
  }
  void shuffle(std::span<std::size_t> order) {
    for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[below(k)]);
  }

 private:
  std::uint64_t seed_, stream_, a_, used_ = 0;
  std::array<double, 4> held_{};
};

}  // namespace

void stratified_scores(std::uint64_t seed, std::uint64_t stream, std::uint64_t a, std::span<double> scores,
                       std::span<double> weight) {
  const std::size_t n = weight.size(), s = scores.size() / n;
  Uniforms random(seed, stream, a);
  // The first rows of a shuffled order have a wide score, each in its turn.
  std::vector<std::size_t> order(n), rows;
  std::iota(order.begin(), order.end(), std::size_t{0});
  random.shuffle(order);
  const auto wide = std::min(n, static_cast<std::size_t>(wide_share * static_cast<double>(n) + random.next()));
  const std::size_t turn = random.below(s);
  std::fill(weight.begin(), weight.end(), 0.0);
  for (std::size_t k = 0; k < s; ++k)
    for (const bool widely : {true, false}) {
      rows.clear();
      for (std::size_t j = 0; j < n; ++j)
        if ((j < wide && (j + turn) % s == k) == widely) rows.push_back(order[j]);
      random.shuffle(rows);
      for (std::size_t j = 0; j < rows.size(); ++j) {
        const double u = (static_cast<double>(j) + random.next()) / static_cast<double>(rows.size());
        const double z = normal_score(std::clamp(u, 1e-300, 1 - 1e-16)) * (widely ? width : 1);
        scores[rows[j] * s + k] = z;
        weight[rows[j]] += std::exp(0.5 * z * z * (1 - 1 / (width * width))) / width;
      }
    }
  for (double& one : weight) one = 1 / (1 - wide_share + wide_share * one / static_cast<double>(s));
}

}  // namespace metastable::markov
