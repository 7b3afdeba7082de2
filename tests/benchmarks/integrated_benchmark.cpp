// Expected steps of the paper's wheel from exact rows, by the digits asked for.

#include <benchmark/benchmark.h>

#include <cmath>

#include "analysis/metastability.h"
#include "analysis/setting.h"
#include "markov/integrated.h"
#include "markov/solver.h"

namespace {

using namespace metastable;

analysis::Setting wheel(int legs) {
  analysis::Setting setting;
  setting.slope_deg = 9.59;
  setting.initial_speed = *analysis::paper_launch(9.59);
  setting.friction = {0.3, 0.05};
  if (legs == 1) setting.wheel.leg_length.assign(8, 0.1519);
  return setting;
}

// The whole study, everything `metastable steps` prints, refined until the tolerance is met.
void integrated_study(benchmark::State& state) {
  const analysis::Problem problem = wheel(static_cast<int>(state.range(1))).problem();
  const analysis::StudyOptions options{.method = analysis::Method::integrated,
                                       .tolerance = std::pow(10.0, -static_cast<double>(state.range(0))),
                                       .threads = static_cast<int>(state.range(2))};
  double nodes = 0;
  for (auto _ : state) nodes = static_cast<double>(analysis::study(problem, options).cells);
  state.counters["nodes"] = nodes;
}

// Rows and one solve on given nodes.
void integrated_rows(benchmark::State& state) {
  const analysis::Problem problem = wheel(1).problem();
  const auto ranges = markov::node_ranges(problem.map, problem.launch, 1);
  const markov::NodeSpace space(ranges, static_cast<std::size_t>(state.range(0)) / markov::NodeSpace::order);
  for (auto _ : state) {
    const auto rows = markov::integrate(problem.map, space, problem.launch, 1);
    benchmark::DoNotOptimize(markov::mean_first_passage(markov::ChainSolver(rows.chain.chain)));
  }
}

BENCHMARK(integrated_study)
    ->ArgNames({"digits", "legs", "threads"})
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond)
    ->Args({4, 1, 1})
    ->Args({8, 1, 1})
    ->Args({8, 1, 2});
BENCHMARK(integrated_rows)->ArgName("nodes")->UseRealTime()->Unit(benchmark::kMillisecond)->Arg(32)->Arg(64)->Arg(128);

}  // namespace
