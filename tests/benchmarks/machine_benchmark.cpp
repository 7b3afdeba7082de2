// Times what this machine does at best of the two operations that no sampled chain can do without.

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "markov/transition_rows/grid.h"

namespace {

constexpr std::size_t count = 1024;  // numbers that stay in the first cache

// Times sums[slot[k]] += weight[k] with slots known beforehand: the least that counting a landing takes.
void count_landings(benchmark::State& state) {
  std::vector<double> sums(1001, 0.0), weight(count, 0.5);
  std::vector<std::int32_t> slot(count);
  for (std::size_t k = 0; k < count; ++k) slot[k] = static_cast<std::int32_t>(200 + (k * 7919) % 600);
  for (auto _ : state) {
    for (std::size_t k = 0; k < count; ++k) sums[static_cast<std::size_t>(slot[k])] += weight[k];
    benchmark::ClobberMemory();
  }
  state.counters["ns_each"] = benchmark::Counter(
      static_cast<double>(count) * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

METASTABLE_WIDE void take_roots(const double* x, double* root) {
  for (std::size_t k = 0; k < count; ++k) root[k] = std::sqrt(x[k]);
}

void square_roots(benchmark::State& state) {
  std::vector<double> x(count), root(count);
  for (std::size_t k = 0; k < count; ++k) x[k] = 20 + 0.05 * static_cast<double>(k);
  for (auto _ : state) {
    take_roots(x.data(), root.data());
    benchmark::DoNotOptimize(root.data());
    benchmark::ClobberMemory();
  }
  state.counters["ns_each"] = benchmark::Counter(
      static_cast<double>(count) * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

// Times a landing found and counted, without the landing itself.
void tally(benchmark::State& state) {
  const auto grid = metastable::markov::Grid::uniform(16, 72, 1000);
  std::vector<double> sums(1001, 0.0), weight(count, 0.5), x(count);
  for (std::size_t k = 0; k < count; ++k) x[k] = 20 + 0.04 * static_cast<double>((k * 7919) % 1024);
  for (auto _ : state) {
    grid.tally(x, weight, sums);
    benchmark::ClobberMemory();
  }
  state.counters["ns_each"] = benchmark::Counter(
      static_cast<double>(count) * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

BENCHMARK(count_landings);
BENCHMARK(square_roots);
BENCHMARK(tally);

}  // namespace
