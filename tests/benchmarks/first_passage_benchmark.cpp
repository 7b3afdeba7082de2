// Times the mean first passage on a full chain by subtraction-free elimination.

#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "markov/chain/elimination.h"

namespace {

using namespace metastable::markov;

// Has rows of uniform random numbers; rest takes 1e9 steps.
Chain full_chain(std::size_t n) {
  constexpr double rest = 1e-9;
  std::mt19937_64 engine(1);
  std::uniform_real_distribution<double> uniform(0.01, 1);
  std::vector<double> matrix(n * n), kill(n, rest);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = 0;
    for (std::size_t j = 0; j < n; ++j) sum += matrix[i * n + j] = uniform(engine);
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] *= (1 - rest) / sum;
  }
  return Chain::from_dense(n, matrix, kill);
}

void first_passage(benchmark::State& state) {
  const Chain chain = full_chain(static_cast<std::size_t>(state.range(0)));
  const std::vector<double> ones(chain.size(), 1.0);
  for (auto _ : state) benchmark::DoNotOptimize(Elimination(chain, static_cast<int>(state.range(1))).solve(ones));
}

BENCHMARK(first_passage)
    ->ArgNames({"states", "threads"})
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond)
    ->Args({2000, 1})
    ->Args({2000, 2})
    ->Args({250, 1})
    ->Args({500, 1})
    ->Args({1000, 1});

}  // namespace
