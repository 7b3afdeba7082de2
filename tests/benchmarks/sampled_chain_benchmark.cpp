// Times the sampled chain of the paper's contact: cells, draws, legs and threads varied one at a time.

#include <benchmark/benchmark.h>

#include "analysis/study/setting.h"
#include "markov/transition_rows/discretization.h"

namespace {

using namespace metastable;

// Has `legs` legs, all different (one: all equal).
analysis::Setting wheel(int legs) {
  analysis::Setting setting;
  setting.wheel.leg_length.assign(8, 0.1519);
  if (legs > 1) {
    setting.wheel.leg_length.clear();
    for (int i = 0; i < legs; ++i) setting.wheel.leg_length.push_back(0.1519 + 1e-4 * ((i * 5) % 7));
  }
  return setting;
}

// Returns the share of the pairs (cell, draw) that are landed: the other draws rest wherever in the cell they start.
double landed_share(const analysis::Problem& problem, const markov::StateSpace& space, std::size_t samples) {
  const markov::Draws draws = markov::make_draws(problem.map.noise_dimension(), {.count = samples});
  const auto table = problem.map.tabulate(0, draws.score);
  const markov::Grid& grid = space.grid(0);
  double pairs = 0;
  for (std::size_t k = 0; k < draws.count(); ++k) {
    std::size_t resting = 0;
    while (resting < grid.cells() && grid.lower(resting) + grid.width(resting) < table->lowest_survivor(k)) ++resting;
    pairs += static_cast<double>(grid.cells() - resting);
  }
  return pairs / static_cast<double>(grid.cells() * draws.count());
}

void sampled_chain(benchmark::State& state) {
  const auto cells = static_cast<std::size_t>(state.range(0)), samples = static_cast<std::size_t>(state.range(1));
  const analysis::Problem problem = wheel(static_cast<int>(state.range(2))).problem();
  const markov::StateSpace space = markov::covering_space(problem.map, problem.launch, cells, 1);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        markov::discretize(problem.map, space, problem.launch,
                           {.draws = {.count = samples}, .threads = static_cast<int>(state.range(3))}));
  state.counters["landed_share"] = landed_share(problem, space, std::min<std::size_t>(samples, 4096));
}

constexpr int all = 100000;
BENCHMARK(sampled_chain)
    ->ArgNames({"cells", "samples", "legs", "threads"})
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond)
    ->Args({1000, all, 1, 1})
    ->Args({1000, all, 1, 2})
    ->Args({125, all, 1, 1})
    ->Args({250, all, 1, 1})
    ->Args({500, all, 1, 1})
    ->Args({2000, all, 1, 1})
    ->Args({1000, all / 8, 1, 1})
    ->Args({1000, all / 4, 1, 1})
    ->Args({1000, all / 2, 1, 1})
    ->Args({1000, all * 2, 1, 1})
    ->Args({250, all / 4, 1, 1})
    ->Args({250, all / 4, 3, 1})
    ->Args({250, all / 4, 6, 1})
    ->Args({250, all / 4, 12, 1});

}  // namespace
