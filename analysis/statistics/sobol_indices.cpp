#include "analysis/statistics/sobol_indices.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "analysis/statistics/random.h"
#include "analysis/statistics/interval_95.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t blocks = 16;

// Draws uniforms 2 p and 2 p + 1 of row `row` of matrix 0 or 1: Philox4x64 at counter (row, p, 3, matrix).
void fill(std::span<double> inputs, std::uint64_t seed, std::uint64_t row, std::uint64_t matrix) {
  const r123::Philox4x64::key_type key{{seed, 0}};
  for (std::size_t i = 0; i < inputs.size(); i += 2) {
    const r123::Philox4x64::ctr_type counter{{row, i / 2, 3, matrix}};
    const auto bits = r123::Philox4x64()(counter, key);
    for (std::size_t j = 0; j < 2 && i + j < inputs.size(); ++j) inputs[i + j] = unit_interval(bits[j]);
  }
}

Estimate interval(const std::vector<double>& values) {
  const TInterval t = t_interval(values);
  return {t.mean, t.mean - t.half_width, t.mean + t.half_width};
}

}  // namespace

std::vector<SobolResult> sobol_indices(const std::vector<std::size_t>& group_sizes, std::size_t outputs,
                                       const std::function<void(std::span<const double>, std::span<double>)>& model,
                                       const SobolOptions& options) {
  const std::size_t per_block = options.samples / blocks;
  if (per_block < 2)
    throw std::invalid_argument(fmt::format("variance shares: {} samples are below 32", options.samples));
  const std::size_t inputs = std::accumulate(group_sizes.begin(), group_sizes.end(), std::size_t{0});
  const std::size_t groups = group_sizes.size(), runs = groups + 2, rows = per_block * blocks;
  // value[row][run][output]; runs go over A, B, and A with group g from B.
  std::vector<double> value(rows * runs * outputs);
  markov::parallel_for(rows, options.threads, [&](std::size_t row) {
    std::vector<double> a(inputs), b(inputs);
    fill(a, options.seed, row, 0);
    fill(b, options.seed, row, 1);
    const std::span<double> out = std::span(value).subspan(row * runs * outputs, runs * outputs);
    model(a, out.subspan(0, outputs));
    model(b, out.subspan(outputs, outputs));
    for (std::size_t g = 0, first = 0; g < groups; first += group_sizes[g], ++g) {
      std::vector<double> mixed = a;
      std::copy_n(b.begin() + static_cast<std::ptrdiff_t>(first), group_sizes[g],
                  mixed.begin() + static_cast<std::ptrdiff_t>(first));
      model(mixed, out.subspan((2 + g) * outputs, outputs));
    }
  });
  std::vector<SobolResult> results(outputs);
  for (std::size_t o = 0; o < outputs; ++o) {
    SobolResult& result = results[o];
    const auto at = [&](std::size_t row, std::size_t run) { return value[(row * runs + run) * outputs + o]; };
    for (std::size_t row = 0; row < rows; ++row)
      result.mean += (at(row, 0) + at(row, 1)) / (2 * static_cast<double>(rows));
    std::vector<std::vector<double>> first(groups), total(groups);
    double variance = 0;
    bool varies = true;
    for (std::size_t block = 0; block < blocks; ++block) {
      double square = 0;
      std::vector<double> first_sum(groups, 0), total_sum(groups, 0);
      for (std::size_t row = block * per_block; row < (block + 1) * per_block; ++row) {
        const double a = at(row, 0) - result.mean, b = at(row, 1) - result.mean;
        square += (a * a + b * b) / 2;
        for (std::size_t g = 0; g < groups; ++g) {
          const double mixed = at(row, 2 + g) - result.mean;
          first_sum[g] += b * (mixed - a);
          total_sum[g] += (a - mixed) * (a - mixed) / 2;
        }
      }
      variance += square / static_cast<double>(rows);
      varies = varies && square > 0;
      for (std::size_t g = 0; g < groups; ++g) {
        first[g].push_back(first_sum[g] / square);
        total[g].push_back(total_sum[g] / square);
      }
    }
    result.sd = std::sqrt(variance);
    if (!varies) continue;
    for (std::size_t g = 0; g < groups; ++g) result.group.push_back({interval(first[g]), interval(total[g])});
  }
  return results;
}

}  // namespace metastable::analysis
