// Times the law `settled`: landings followed and read, the table, a study from it.

#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "dynamics/return_map/settled_return_map.h"
#include "dynamics/settled/settled_map.h"
#include "markov/parallel.h"

namespace {

using namespace metastable;

// Has mu ~ N(0.4, 0.03^2), eta ~ N(0.4, 0.05^2), J = 0.0025 kg m^2: what the engines were given.
analysis::Setting engine_wheel() {
  analysis::Setting setting;
  setting.law = dynamics::Law::settled;
  setting.wheel.radius_of_gyration = std::sqrt(0.0025 / setting.wheel.hub_mass);
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.4, 0.03};
  return setting;
}

dynamics::SettledMapOptions on_threads(int threads) {
  dynamics::SettledMapOptions options;
  options.executor = markov::on_threads(threads);
  return options;
}

dynamics::SettledWheel wheel(const analysis::Setting& setting) {
  return dynamics::settled_wheel(setting.wheel, setting.slope_deg * std::numbers::pi / 180);
}

// Goes over speeds, restitutions and frictions of steady rolling.
template <class Land>
void landings(benchmark::State& state, const Land& land) {
  std::size_t k = 0;
  for (auto _ : state) {
    const double one = std::fmod(0.618 * static_cast<double>(k), 1.0),
                 two = std::fmod(0.414 * static_cast<double>(k), 1.0);
    benchmark::DoNotOptimize(land(static_cast<int>(k % 8), 4.3 + one, {0.3 + 0.2 * two, 0.34 + 0.12 * one}));
    ++k;
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(k));
}

void landings_followed(benchmark::State& state) {
  const dynamics::SettledMotion motion(wheel(engine_wheel()));
  landings(state, [&](int leg, double omega, const dynamics::Contact& c) { return motion.land(leg, omega, c); });
}

void landings_read(benchmark::State& state) {
  const auto map = dynamics::SettledMap::of(wheel(engine_wheel()), on_threads(0));
  landings(state, [&](int leg, double omega, const dynamics::Contact& c) { return map->land(leg, omega, c); });
}

// It goes to another slope each time: tables are kept.
void table(benchmark::State& state) {
  analysis::Setting setting = engine_wheel();
  static double slope_deg = setting.slope_deg;
  for (auto _ : state) {
    setting.slope_deg = slope_deg += 0.001;
    benchmark::DoNotOptimize(dynamics::SettledMap::of(wheel(setting), on_threads(static_cast<int>(state.range(0)))));
  }
}

// Times the whole study, everything `metastable steps` prints, from the table; under `published` beside it.
void study(benchmark::State& state, dynamics::Law law) {
  analysis::Setting setting = engine_wheel();
  setting.law = law;
  if (law == dynamics::Law::published) setting.wheel.radius_of_gyration.reset();
  const analysis::Problem problem = setting.problem();
  const analysis::StudyOptions options{.method = state.range(0) == 0 ? analysis::Method::sampled
                                                                     : analysis::Method::integrated};
  for (auto _ : state) benchmark::DoNotOptimize(analysis::study(problem, options));
}

// Says by how much a table of twice the nodes moves the expected steps: equal legs, eta ~ N(0.3, 0.05^2), sd of mu
// 0.03.
void twice_the_nodes(benchmark::State& state) {
  analysis::Setting setting = engine_wheel();
  setting.wheel.leg_length.assign(8, 0.1519);
  setting.restitution = {0.3, 0.05};
  setting.friction = {0.01 * static_cast<double>(state.range(0)), 0.03};
  const dynamics::LaunchSpeed speed = setting.launch();
  const auto steps = [&](int times) {
    dynamics::SettledMapOptions options = on_threads(0);
    options.speeds *= times, options.restitutions *= times, options.frictions *= times;
    const dynamics::SettledReturnMap map(setting.wheel, setting.slope_deg * std::numbers::pi / 180, setting.noise(),
                                         speed.at_score(6), options);
    const auto launch = [&](double score) { return std::pow(speed.at_score(score), 2); };
    const analysis::Problem problem{map, {launch, 0}, [](double square) { return std::sqrt(square); }, {}};
    return analysis::study(problem, {.method = analysis::Method::integrated, .tolerance = 1e-6}).steps.from_start.value;
  };
  for (auto _ : state) {
    const double single = steps(1);
    state.counters["steps"] = single;
    state.counters["moved"] = steps(2) / single - 1;
  }
}

// Runs each once: these take seconds.
void once(benchmark::internal::Benchmark* of) {
  of->UseRealTime()->MeasureProcessCPUTime()->Unit(benchmark::kSecond)->Iterations(1);
}

BENCHMARK(landings_followed);
BENCHMARK(landings_read);
BENCHMARK(twice_the_nodes)->ArgName("mu*100")->Arg(33)->Arg(44)->Arg(48)->Arg(51)->Arg(54)->Arg(57)->Apply(once);
BENCHMARK(table)->ArgName("threads")->Arg(1)->Arg(2)->Apply(once);
BENCHMARK_CAPTURE(study, settled, dynamics::Law::settled)->ArgName("integrated")->Arg(0)->Arg(1)->Apply(once);
BENCHMARK_CAPTURE(study, published, dynamics::Law::published)->ArgName("integrated")->Arg(0)->Arg(1)->Apply(once);

}  // namespace
