#include "analysis/study/verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "dynamics/return_map/rough_terrain.h"
#include "markov/chain/eigenpairs.h"
#include "markov/chain/solver.h"
#include "markov/chain/sparse_solver.h"
#include "markov/parallel.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/integrated.h"

namespace metastable::analysis {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr std::size_t first_verified_panels = 4;
constexpr double equal_leg = 0.1519;  // [m]

Benchmark rough_terrain(double sd_deg) {
  const dynamics::RoughTerrainWheel wheel({.mean_slope_rad = 8 * degree, .sd_slope_rad = sd_deg * degree});
  const double start = wheel.fixed_point();
  return {fmt::format("rough terrain, sd {} deg", sd_deg),
          {wheel, {[start](double) { return start; }, 0}, [](double state) { return state; }, {}},
          1e-10,
          {},
          {},
          {}};
}

Benchmark wheel(double slope_deg, Spread friction, bool equal_legs) {
  Setting setting;
  if (equal_legs) setting.wheel.leg_length.assign(8, equal_leg);
  setting.slope_deg = slope_deg;
  setting.friction = friction;
  setting.initial_speed = *paper_launch(slope_deg);
  return {fmt::format("{} deg, mu ~ N({}, {}^2), {}", slope_deg, friction.mean, friction.sd,
                      equal_legs ? "equal legs" : "the paper's legs"),
          setting.problem(),
          1e-8,
          {},
          {},
          {},
          true};
}

double by_launch(const markov::Launch& launch, const std::vector<double>& mean) {
  return 1 + std::inner_product(mean.begin(), mean.end(), launch.after.begin(), 0.0);
}

void answer(Verified& result) {
  const markov::ChainSolver solver(result.chain.chain);
  result.from_start = by_launch(result.chain.launch, markov::mean_first_passage(solver));
  result.failure_rate = markov::quasi_stationary(solver, markov::FewSurvivors::unsettled).failure_rate;
  result.from_quasi_stationary = 1 / result.failure_rate;
}

void ask_other_solvers(Verified& result) {
  const markov::Chain& chain = result.chain.chain;
  try {
    const std::vector<double> ones(chain.size(), 1.0);
    result.lu_from_start = by_launch(result.chain.launch, markov::SparseSolver(chain).solve(ones));
  } catch (const markov::ConvergenceError&) {
    result.lu_from_start.reset();
  }
  try {
    const markov::ChainSolver solver(chain);
    const double lambda = std::abs(markov::leading_eigenpairs(solver.revolution(), 1).values.front());
    const double per_step = std::pow(lambda, 1.0 / solver.period().period);
    result.arnoldi_from_quasi_stationary = 1 / (1 - per_step);
  } catch (const markov::ConvergenceError&) {
    result.arnoldi_from_quasi_stationary.reset();
  }
}

}  // namespace

std::vector<Benchmark> rough_terrain_benchmarks() {
  std::vector<Benchmark> all;
  for (const double sd : {2.0, 1.5, 1.0, 0.7, 0.6, 0.525}) all.push_back(rough_terrain(sd));
  // These are for the wheel of Byl and Tedrake (IJRR 28, 2009) at a mean slope of 8 deg: its integral equation solved
  // with numbers of sixty digits. tests/markov/transition_rows/rough_terrain_test.cpp solves it once more, in double
  // precision.
  const double known[][3] = {{2.3121853052586986e-4, 4324.9128766870834, 4326.1846791959863},
                             {1.5280057867965971e-6, 654447.78327473479, 654449.43992398285},
                             {1.1990367683962527e-12, 834002781530.65289, 834002781532.82850}};
  for (std::size_t i = 0; i < std::size(known); ++i) {
    all[i].known_failure_rate = known[i][0];
    all[i].known_from_quasi_stationary = known[i][1];
    all[i].known_from_start = known[i][2];
  }
  return all;
}

std::vector<Benchmark> wheel_benchmarks() {
  return {wheel(7.02, {0.45, 0.1}, true), wheel(7.02, {0.4, 0.1}, true),  wheel(7.02, {0.4, 0.1}, false),
          wheel(7.02, {0.3, 0.05}, true), wheel(9.59, {0.3, 0.05}, true), wheel(7.02, {0.3, 0.03}, true),
          wheel(7.02, {0.3, 0.02}, true), wheel(9.59, {0.3, 0.024}, true)};
}

Verified verify(const Benchmark& benchmark, int threads, std::size_t most_nodes) {
  const auto ranges = markov::node_ranges(benchmark.problem.map, benchmark.problem.launch, threads);
  if (ranges.empty()) throw std::invalid_argument(benchmark.name + ": rest is out of reach");
  Verified result;
  for (std::size_t panels = first_verified_panels;; panels *= 2) {
    const markov::NodeSpace space(ranges, panels);
    Verified next;
    next.nodes = space.nodes();
    next.chain = markov::integrate(benchmark.problem.map, space, benchmark.problem.launch, threads).chain;
    answer(next);
    const bool first = result.nodes == 0;
    if (!first)
      next.change = std::max(std::abs(next.from_start / result.from_start - 1),
                             std::abs(next.failure_rate / result.failure_rate - 1));
    result = std::move(next);
    if (!first && (result.change <= benchmark.tolerance || 2 * result.nodes > most_nodes)) break;
  }
  const auto compare = [&](double value, const std::optional<double>& known) {
    if (known) result.error = std::max(result.error.value_or(0), std::abs(value / *known - 1));
  };
  compare(result.failure_rate, benchmark.known_failure_rate);
  compare(result.from_quasi_stationary, benchmark.known_from_quasi_stationary);
  compare(result.from_start, benchmark.known_from_start);
  if (benchmark.by_collocation) {
    StudyOptions options;
    options.method = Method::integrated;
    options.tolerance = benchmark.tolerance;
    options.threads = threads;
    const Metastability other = study(benchmark.problem, options);
    compare(result.failure_rate, other.spectrum.failure_rate.value);
    compare(result.from_start, other.steps.from_start.value);
  }
  ask_other_solvers(result);
  return result;
}

std::vector<VerifiedTable> verify_tables(int threads) {
  dynamics::Wheel wheel;
  wheel.radius_of_gyration = std::sqrt(0.0025 / wheel.hub_mass);
  dynamics::SettledMapOptions options;
  options.executor = markov::on_threads(threads);
  const auto error_at = [&](double slope_deg) {
    return dynamics::SettledMap::of(dynamics::settled_wheel(wheel, slope_deg * degree), options)->error();
  };
  std::vector<VerifiedTable> all{{"the paper's legs", 7.02, error_at(7.02)}};
  wheel.leg_length.assign(8, equal_leg);
  all.push_back({"equal legs", 9.59, error_at(9.59)});
  return all;
}

Coverage coverage(const Problem& problem, double from_start, int seeds, int threads) {
  Coverage result;
  for (int seed = 1; seed <= seeds; ++seed) {
    StudyOptions options;
    options.seed = static_cast<std::uint64_t>(seed);
    options.threads = threads;
    const Estimate steps = study(problem, options).steps.from_start;
    ++result.seeds;
    if (steps.lower <= from_start && from_start <= steps.upper) ++result.inside;
    const double half = 0.5 * (steps.upper - steps.lower) / steps.value;
    result.widest = std::max(result.widest, std::isfinite(half) ? half : infinite);
  }
  return result;
}

}  // namespace metastable::analysis
