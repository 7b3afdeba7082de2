// Counts how often the intervals of mesh studies hold what simulations say, and quadrature where it reaches: ten
// settings, 20 seeds each.
//   mesh_coverage [seeds] [first setting] [settings] [first seed]

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/walkers/walker_study.h"
#include "markov/mesh/batch_simulation.h"
#include "markov/mesh/mesh_study.h"
#include "markov/normal_95.h"
#include "tests/benchmarks/coverage.h"
#include "tests/markov/mesh/maps.h"

namespace {

using namespace metastable;

struct Tried {
  std::string name;
  markov::BatchMap map;
  std::vector<double> start;
  std::size_t trials;  ///< simulated
  std::optional<double> exact = {};
};

Tried walker(analysis::Walker kind, double sd_rad, std::size_t trials) {
  auto [map, start] = walker_in_gait(kind, sd_rad / analysis::degree, dynamics::Terrain::fresh);
  return {fmt::format("{}, sd {} rad", analysis::walker_name(kind), sd_rad), std::move(map), std::move(start), trials};
}

/// From 1e1 to 1e5 steps. Quadrature knows the linear map; of two dimensions one does not matter to failure.
std::vector<Tried> settings() {
  using namespace markov::testing;
  using analysis::Walker;
  std::vector<Tried> all;
  for (const auto& [sd, trials] : {std::pair(1.5, 200000), std::pair(0.8, 200000), std::pair(0.4, 4000)})
    all.push_back({fmt::format("linear, sd {}", sd),
                   linear_batch(sd),
                   {2},
                   static_cast<std::size_t>(trials),
                   linear_steps(sd, 2)});
  for (const auto& [sd, trials] : {std::pair(0.8, 200000), std::pair(0.5, 40000)})
    all.push_back({fmt::format("two phases, sd {}", sd), two_phase_batch(sd), {2}, static_cast<std::size_t>(trials)});
  for (const auto& [sd, trials] : {std::pair(1.5, 200000), std::pair(0.8, 100000)})
    all.push_back({fmt::format("two dimensions, sd {}", sd),
                   skew_batch(sd),
                   {2, -2.0 / 3},
                   static_cast<std::size_t>(trials),
                   linear_steps(sd, 2)});
  all.push_back(walker(Walker::simplest, 0.0015, 200000));
  all.push_back(walker(Walker::simplest, 0.0008, 20000));
  all.push_back(walker(Walker::compass, 0.012, 100000));
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Tried> all = settings();
  const auto [seeds, first_seed, first, last] = asked(argc, argv, 20, all.size());
  for (std::size_t i = first; i < last; ++i) {
    const Tried& tried = all[i];
    const auto simulated =
        markov::simulate_steps(tried.map, tried.start, {.trials = tried.trials, .seed = 99, .threads = 1});
    const double relative = simulated->standard_error / simulated->mean;
    int held = 0, exactly = 0;
    double width = 0, bias = 0;
    for (int seed = first_seed; seed < first_seed + seeds; ++seed) {
      const markov::MeshStudy study = markov::mesh_study(
          tried.map, tried.start,
          {.seed = static_cast<std::uint64_t>(seed), .threads = 1, .guided_samples = 0, .simulated_steps = 0});
      const double off = std::log(study.steps.value / simulated->mean),
                   half = 0.5 * std::log(study.steps.upper / study.steps.lower);
      held += std::abs(off) <= std::hypot(half, markov::normal_95 * relative);
      exactly += tried.exact && study.steps.lower <= *tried.exact && *tried.exact <= study.steps.upper;
      width += half / seeds;
      bias += off / seeds;
    }
    fmt::print("{:<26} {:>10.5g} ({:.2g} %): held by {} of {}, half-width {:.2g} %, mean deviation {:.2g} %",
               tried.name, simulated->mean, 100 * relative, held, seeds, 100 * width, 100 * bias);
    fmt::print("{}\n", tried.exact ? fmt::format("; quadrature {:.6g} held by {}", *tried.exact, exactly) : "");
    std::fflush(stdout);
  }
}
