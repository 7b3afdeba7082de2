#include "analysis/statistics/random.h"

#include <Random123/philox.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

// These are the second words of the Philox keys: "mult", "shri", "fold", "even".
constexpr std::uint64_t multiplier_key = 0x6d756c74, weight_key = 0x73687269, fold_key = 0x666f6c64,
                        even_key = 0x6576656e;

r123::Philox4x64::ctr_type words(const r123::Philox4x64::ctr_type& counter, std::uint64_t seed, std::uint64_t key) {
  return r123::Philox4x64()(counter, {{seed, key}});
}

}  // namespace

double uniform_at(std::uint64_t seed, std::uint64_t index, std::uint64_t number, std::uint64_t stream) {
  return unit_interval(words({{index, number, stream, 0}}, seed, 0)[0]);
}

std::vector<double> normal_multipliers(std::uint64_t seed, std::uint64_t draw, DrawStream stream, std::size_t count) {
  std::vector<double> multipliers(count);
  for (std::size_t t = 0; t < count; t += 4) {
    const auto bits = words({{draw, t, static_cast<std::uint64_t>(stream), 0}}, seed, multiplier_key);
    for (std::size_t i = 0; i < 4 && t + i < count; ++i)
      multipliers[t + i] = dynamics::normal_quantile(unit_interval(bits[i]));
  }
  return multipliers;
}

std::vector<double> even_normals(std::uint64_t seed, std::uint64_t draw, std::size_t count) {
  std::vector<std::pair<std::uint64_t, double>> order(count);  // by a random word, and where in its cell
  for (std::size_t i = 0; i < count; ++i) {
    const auto bits = words({{draw, i, static_cast<std::uint64_t>(DrawStream::blur), 0}}, seed, even_key);
    order[i] = {bits[0], unit_interval(bits[1])};
  }
  std::vector<std::size_t> cell(count);
  std::iota(cell.begin(), cell.end(), std::size_t{0});
  std::sort(cell.begin(), cell.end(), [&](std::size_t a, std::size_t b) { return order[a] < order[b]; });
  std::vector<double> normals(count);
  for (std::size_t i = 0; i < count; ++i)
    normals[i] =
        dynamics::normal_quantile((static_cast<double>(cell[i]) + order[i].second) / static_cast<double>(count));
  return normals;
}

double exponential_weight(std::uint64_t seed, std::uint64_t draw, std::uint64_t trial) {
  const auto stream = static_cast<std::uint64_t>(DrawStream::held_out_weights);
  return -std::log(unit_interval(words({{draw, trial, stream, 0}}, seed, weight_key)[0]));
}

std::uint64_t shuffling_key(std::uint64_t seed, std::uint64_t trial) {
  return words({{trial, static_cast<std::uint64_t>(DrawStream::folds), 0, 0}}, seed, fold_key)[0];
}

}  // namespace metastable::analysis
