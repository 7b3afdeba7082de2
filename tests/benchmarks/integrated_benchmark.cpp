// Times expected steps of the paper's wheel from exact rows, by the digits asked for.

#include <benchmark/benchmark.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "markov/chain/solver.h"
#include "markov/passage/first_passage.h"
#include "markov/transition_rows/integrated.h"

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

// Times the whole study, everything `metastable steps` prints, refined until the tolerance is met.
void integrated_study(benchmark::State& state) {
  const analysis::Problem problem = wheel(static_cast<int>(state.range(1))).problem();
  const analysis::StudyOptions options{.method = analysis::Method::integrated,
                                       .tolerance = std::pow(10.0, -static_cast<double>(state.range(0))),
                                       .threads = static_cast<int>(state.range(2))};
  double nodes = 0;
  for (auto _ : state) nodes = static_cast<double>(analysis::study(problem, options).cells);
  state.counters["nodes"] = nodes;
}

// Times expected steps of the paper's wheel, its eight legs at 7.02 deg, to eight digits and nothing else: the range of
// the nodes, rows on 48 of them a leg, one solve. On 128 it is 4.251111596; the error is 4e-9.
void expected_steps(benchmark::State& state) {
  analysis::Setting setting;
  setting.initial_speed = *analysis::paper_launch(7.02);
  const analysis::Problem problem = setting.problem();
  double steps = 0;
  for (auto _ : state) {
    const markov::NodeSpace space(markov::node_ranges(problem.map, problem.launch, 1), 3);
    const markov::SampledChain rows = markov::integrate(problem.map, space, problem.launch, 1).chain;
    const std::vector<double> mean = markov::mean_first_passage(markov::ChainSolver(rows.chain));
    steps = 1 + std::inner_product(mean.begin(), mean.end(), rows.launch.after.begin(), 0.0);
  }
  state.counters["error"] = std::abs(steps / 4.251111596 - 1);
}

// Times rows and one solve on given nodes.
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
BENCHMARK(expected_steps)->UseRealTime()->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);
BENCHMARK(integrated_rows)->ArgName("nodes")->UseRealTime()->Unit(benchmark::kMillisecond)->Arg(32)->Arg(64)->Arg(128);

}  // namespace
