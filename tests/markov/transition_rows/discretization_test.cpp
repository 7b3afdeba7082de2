#include "markov/transition_rows/discretization.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/chain_pool.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

// A third party's map, made without touching markov/: x' = a x + b + s z, rest below zero.
struct LinearMap {
  double a = 0.5, b = 2.0, s = 1.0;
  std::pair<double, double> state_interval(int) const { return {0.0, INFINITY}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int, std::span<const double> noise) const {
    const double next = a * state + b + s * noise[0];
    if (next < 0) return std::nullopt;
    return next;
  }
};

// The same with its probability of rest and a faster table.
struct InformedMap : LinearMap {
  struct Table {
    std::vector<double> shift;
    double a;
    void land(double origin, double width, std::span<const double> offset, std::size_t first,
              std::span<double> next) const {
      for (std::size_t k = 0; k < next.size(); ++k) {
        const double landed = a * (origin + width * offset[k]) + shift[first + k];
        next[k] = landed < 0 ? rest_landing : landed;
      }
    }
  };
  Table tabulate(int, std::span<const double> noise) const {
    Table table{{}, a};
    for (const double z : noise) table.shift.push_back(b + s * z);
    return table;
  }
  std::optional<double> rest_probability(double state, int) const {
    return 0.5 * std::erfc((a * state + b) / s / std::sqrt(2.0));
  }
};

// The same dynamics seen every other step under another name: period two.
struct TwoPhaseMap : LinearMap {
  int phases() const { return 2; }
};

const LaunchState from_four{[](double) { return 4.0; }, 0};

double steps_from_launch_of(const SampledChain& sampled) {
  const ChainSolver solver(sampled.chain);
  const std::vector<double> mean = mean_first_passage(solver);
  return 1 + std::inner_product(mean.begin(), mean.end(), sampled.launch.after.begin(), 0.0);
}

// Integrates by trapezoid on a fine grid of starts and a closed-form kernel: independent of cells and draws.
double reference_steps(const LinearMap& map) {
  constexpr int n = 1500;
  const double top = 14.0, h = top / n;
  const auto density = [&](double from, double to) {
    const double z = (to - map.a * from - map.b) / map.s;
    return std::exp(-0.5 * z * z) / map.s / std::sqrt(2 * M_PI);
  };
  std::vector<double> off(static_cast<std::size_t>(n) * n), kill(n);
  for (int i = 0; i < n; ++i) {
    const double x = (i + 0.5) * h;
    double total = 0;
    for (int j = 0; j < n; ++j)
      total += off[static_cast<std::size_t>(i) * n + static_cast<std::size_t>(j)] = density(x, (j + 0.5) * h) * h;
    kill[static_cast<std::size_t>(i)] = 0.5 * std::erfc((map.a * x + map.b) / map.s / std::sqrt(2.0));
    EXPECT_NEAR(total + kill[static_cast<std::size_t>(i)], 1.0, 1e-6);
  }
  const Chain chain = Chain::from_dense(n, off, kill);
  const ChainSolver solver(chain);
  const std::vector<double> mean = mean_first_passage(solver);
  double steps = 1;
  for (int j = 0; j < n; ++j) steps += density(4.0, (j + 0.5) * h) * h * mean[static_cast<std::size_t>(j)];
  return steps;
}

TEST(Discretization, ThirdPartyMapConvergesToItsIntegralEquation) {
  const LinearMap map;
  const StateSpace space = covering_space(map, from_four, 256, 1);
  const SampledChain sampled = discretize(map, space, from_four, {.draws = {.count = 16384}});
  EXPECT_NEAR(steps_from_launch_of(sampled) / reference_steps(map), 1.0, 2e-3);
}

TEST(Discretization, ErrorFallsWithTheSquareOfTheCellWidth) {
  const InformedMap map;
  StateSpace space = covering_space(map, from_four, 8, 1);
  std::vector<double> log_steps;
  for (int level = 0; level < 4; ++level, space = space.halved())
    log_steps.push_back(std::log(steps_from_launch_of(discretize(map, space, from_four, {.draws = {.count = 65536}}))));
  const double first = (log_steps[1] - log_steps[0]) / (log_steps[2] - log_steps[1]);
  const double second = (log_steps[2] - log_steps[1]) / (log_steps[3] - log_steps[2]);
  EXPECT_NEAR(std::log2(first), 2.0, 0.35);
  EXPECT_NEAR(std::log2(second), 2.0, 0.35);
  EXPECT_GT(log_steps[1], log_steps[0]);  // coarse cells come out low
}

TEST(Discretization, ExactRestAgreesWithCountedRest) {
  InformedMap map;
  map.s = 0.35;  // rest at about 1e-8 per step
  const StateSpace space = covering_space(map, from_four, 200, 1);
  const Discretization counted{.draws = {.count = 65536}};
  Discretization exact = counted;
  exact.exact_rest = true;
  const double a = steps_from_launch_of(discretize(map, space, from_four, counted));
  const double b = steps_from_launch_of(discretize(map, space, from_four, exact));
  EXPECT_GT(a, 1e7);
  EXPECT_NEAR(a / b, 1.0, 0.02);
}

TEST(Discretization, RowsAndLaunchSumToOne) {
  const SampledChain sampled =
      discretize(TwoPhaseMap{}, covering_space(TwoPhaseMap{}, from_four, 64, 1), from_four, {});
  for (std::size_t i = 0; i < sampled.chain.size(); ++i) {
    const auto values = sampled.chain.values(i);
    EXPECT_NEAR(std::accumulate(values.begin(), values.end(), sampled.chain.kill(i)), 1.0,
                1e-12);  // two phases: no staying
  }
  EXPECT_NEAR(std::accumulate(sampled.launch.after.begin(), sampled.launch.after.end(), sampled.launch.rest), 1.0,
              1e-12);
  EXPECT_EQ(find_period(sampled.chain).period, 2);
}

TEST(Discretization, BitsDoNotDependOnThreadsNorOnTheTable) {
  const StateSpace space = covering_space(LinearMap{}, from_four, 100, 1);
  const auto sample = [&](const AnyReturnMap& map, int threads) {
    return discretize(map, space, from_four, {.draws = {.count = 5000}, .threads = threads}).chain;
  };
  const Chain one = sample(LinearMap{}, 1);
  const auto expect_same = [&](const Chain& other) {
    ASSERT_EQ(one.entries(), other.entries());
    for (std::size_t i = 0; i < one.size(); ++i) {
      EXPECT_EQ(one.kill(i), other.kill(i));
      for (std::size_t k = 0; k < one.values(i).size(); ++k) EXPECT_EQ(one.values(i)[k], other.values(i)[k]);
    }
  };
  expect_same(sample(LinearMap{}, 2));
  expect_same(sample(LinearMap{}, 5));
}

TEST(ChainPool, MeanOfOneChainIsThatChainAndOfTwoTheirAverage) {
  const StateSpace space = covering_space(LinearMap{}, from_four, 40, 1);
  const SampledChain a = discretize(LinearMap{}, space, from_four, {.draws = {.count = 1000}});
  const SampledChain b = discretize(LinearMap{}, space, from_four, {.draws = {.count = 1000, .replicate = 1}});
  ChainPool pool;
  EXPECT_THROW(pool.mean(), std::logic_error);
  pool.add(a);
  EXPECT_DOUBLE_EQ(steps_from_launch_of(pool.mean()), steps_from_launch_of(a));
  pool.add(b);
  const SampledChain mean = pool.mean();
  EXPECT_DOUBLE_EQ(mean.chain.kill(0), 0.5 * (a.chain.kill(0) + b.chain.kill(0)));
  const double lower = std::min(steps_from_launch_of(a), steps_from_launch_of(b));
  const double upper = std::max(steps_from_launch_of(a), steps_from_launch_of(b));
  EXPECT_GE(steps_from_launch_of(mean), lower * (1 - 1e-4));
  EXPECT_LE(steps_from_launch_of(mean), upper * (1 + 1e-4));
  const StateSpace other = covering_space(LinearMap{}, from_four, 41, 1);
  EXPECT_THROW(pool.add(discretize(LinearMap{}, other, from_four, {.draws = {.count = 1000}})), std::invalid_argument);
}

TEST(StateSpace, GradedCellsKeepTheRangeThatMatters) {
  const Discretization options{.draws = {.count = 8192}};
  const StateSpace pilot = covering_space(LinearMap{}, from_four, 96, 1, 4.0);
  const SampledChain sampled = discretize(LinearMap{}, pilot, from_four, options);
  const ChainSolver solver(sampled.chain);
  const QuasiStationary quasi = quasi_stationary(solver);
  EXPECT_LT(top_share(pilot, quasi.distribution), 1e-10);
  const StateSpace graded = graded_space(pilot, quasi.distribution, quasi.survival_weight, sampled.launch.after, 64);
  const Grid& grid = graded.grid(0);
  EXPECT_EQ(grid.cells(), 64u);
  EXPECT_EQ(grid.lower(0), 0.0);
  EXPECT_GT(grid.edges().back(), 4 + 6 * 1.15);  // the stationary mean and six of its sds
  EXPECT_LT(grid.edges().back(), pilot.grid(0).edges().back());
  double narrowest = INFINITY, widest_low = 0;
  for (std::size_t c = 0; c < 64; ++c) {
    narrowest = std::min(narrowest, grid.width(c));
    if (grid.lower(c) < 6) widest_low = std::max(widest_low, grid.width(c));
  }
  EXPECT_LE(widest_low / narrowest, 4.2);
  EXPECT_NEAR(steps_from_launch_of(discretize(LinearMap{}, graded, from_four, options)) / reference_steps(LinearMap{}),
              1.0, 0.02);
}

TEST(StateSpace, UpperEdgeHoldsTheRegimeAndTheLaunch) {
  const StateSpace space = covering_space(LinearMap{}, {[](double) { return 40.0; }, 0}, 32, 1);
  EXPECT_GT(space.grid(0).edges().back(), 0.5 * 40 + 2 + 3);
  EXPECT_THROW(StateSpace({}), std::invalid_argument);
  EXPECT_THROW(StateSpace({Grid::uniform(0, 1, 4), Grid::uniform(0, 1, 5)}), std::invalid_argument);
}

TEST(ViolationRates, CountWhatTheMapReports) {
  struct Watched : LinearMap {
    std::vector<std::string> assumptions() const { return {"score above zero", "state above four"}; }
    bool violates(int which, double state, int, std::span<const double> noise) const {
      return which == 0 ? noise[0] > 0 : state > 4;
    }
  };
  const StateSpace space({Grid::uniform(0, 8, 4)});
  const std::vector<std::size_t> counts{64, 0, 32, 64};
  const auto rates = violation_rates(Watched{}, space, {[](double) { return 5.0; }, 0}, counts, {.count = 64});
  ASSERT_EQ(rates.size(), 2u);
  EXPECT_NEAR(rates[0][0], 0.5, 0.02);
  EXPECT_EQ(rates[0][1], 0.0);  // without draws
  EXPECT_EQ(rates[1][0], 0.0);
  EXPECT_NEAR(rates[1][3], 1.0, 1e-12);
  EXPECT_NEAR(rates[1].back(), 1.0, 1e-12);  // the launch
}

// A map with a hole: what lands nowhere must not pass for rest.
struct MapWithAHole : LinearMap {
  std::optional<double> landing(double state, int phase, std::span<const double> noise) const {
    return state > 3 && state < 3.1 ? std::numeric_limits<double>::quiet_NaN()
                                    : *LinearMap::landing(state, phase, noise);
  }
};

TEST(Discretization, LandingThatIsNoNumberIsAnErrorNamingTheState) {
  MapWithAHole map;
  map.b = 20;
  const auto message = [&](double launched) -> std::string {
    return message_of<std::domain_error>([&] {
      discretize(map, StateSpace({Grid::uniform(0, 60, 200)}), {[=](double) { return launched; }, 0}, {});
    });
  };
  EXPECT_NE(message(40).find("return map: the landing from state 3.0"), std::string::npos) << message(40);
}

}  // namespace
}  // namespace metastable::markov
