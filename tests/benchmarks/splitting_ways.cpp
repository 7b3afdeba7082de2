// Holds the weighted ensemble against fixed-effort multilevel splitting, by the same level and the same thresholds:
// steps of the map times the relative variance of the failure rate. Their ratio says how many times fewer steps the
// first takes, with scores spread evenly over its bins and with plain draws, as the second has them.
//   splitting_ways [repetitions] [first setting] [settings] [first seed]

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "markov/splitting/level_pilot.h"
#include "markov/splitting/mesh_level.h"
#include "markov/transition_rows/draws.h"
#include "tests/benchmarks/coverage.h"
#include "tests/benchmarks/multilevel.h"

namespace {

using namespace metastable;

struct Tried {
  std::string name;
  std::pair<markov::BatchMap, std::vector<double>> map;
};

/// Maps x' = 0.9 x + sqrt(0.19) z, of unit variance; it fails beyond 4.9.
Tried slow_line() {
  Tried tried{"x' = 0.9 x + 0.44 z, beyond 4.9", {{}, {0}}};
  tried.map.first.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = 0.9 * states[i] + std::sqrt(0.19) * scores[i];
      failed[i] = next[i] > 4.9;
    }
  };
  return tried;
}

/// Returns a map of one score that draws for itself: ensembles then do not spread its scores evenly.
markov::BatchMap drawing(const markov::BatchMap& map) {
  markov::BatchMap drawn = map;
  drawn.scores = 0;
  drawn.draw = [step = map.step](int phase, auto states, auto words, auto next, auto failed) {
    std::vector<double> scores;
    for (const std::uint64_t word : words)
      scores.push_back(markov::normal_score((static_cast<double>(word >> 11) + 0.5) * 0x1p-53));
    step(phase, states, scores, next, failed);
  };
  return drawn;
}

Rate follow_ensemble(const markov::BatchMap& map, const std::vector<double>& start, const markov::Levels& levels,
                     std::uint64_t seed, std::uint64_t stream) {
  markov::WeightedEnsemble ensemble(map, start, walks, seed, stream);
  ensemble.set_levels(levels);
  for (std::uint64_t n = 0; n < burn_in; ++n) ensemble.advance();
  double sum = 0;
  for (std::uint64_t n = 0; n < kept; ++n) sum += ensemble.advance();
  return {sum / kept, static_cast<double>(ensemble.calls())};
}

/// Prints one over the mean rate, its error, and what it costs. Returns the steps times the relative variance.
double tell_cost(const char* way, const std::vector<Rate>& rates) {
  const double n = static_cast<double>(rates.size());
  double mean = 0, calls = 0, squares = 0;
  for (const Rate& one : rates) mean += one.rate / n, calls += one.calls / n;
  for (const Rate& one : rates) squares += std::pow(one.rate / mean - 1, 2) / (n - 1);
  fmt::print(
      "  {:<34} {:.4g} steps (standard error {:.2g} %); {:.3g} steps of the map a repetition, times the relative "
      "variance {:.3g}; direct simulation {:.3g} times as many\n",
      way, 1 / mean, 100 * std::sqrt(squares / n), calls, calls * squares, 1 / mean / (calls * squares));
  return calls * squares;
}

void compare(const Tried& tried, std::uint64_t repetitions, std::uint64_t seed) {
  const auto& [map, start] = tried.map;
  const markov::BatchMap drawn = drawing(map);
  const markov::MeshLevel read = markov::mesh_level(map, start, {.seed = seed});
  const markov::Levels levels = markov::level_pilot(map, start, {.level = read.level, .seed = seed}).levels;
  Multilevel multilevel(map, start, levels, seed);
  std::vector<Rate> spread, plain, stages;
  for (std::uint64_t r = 1; r <= repetitions; ++r) {
    spread.push_back(follow_ensemble(map, start, levels, seed, r));
    plain.push_back(follow_ensemble(drawn, start, levels, seed, r));
    stages.push_back(multilevel.run(r));
  }
  fmt::print("{}, {} thresholds:\n", tried.name, levels.edges.front().size());
  const double a = tell_cost("weighted ensemble, scores spread", spread),
               b = tell_cost("weighted ensemble, plain draws", plain), c = tell_cost("multilevel, plain draws", stages);
  fmt::print("  multilevel over weighted ensemble: {:.3g}, of plain draws {:.3g}\n", c / a, c / b);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  using analysis::Walker;
  const std::vector<Tried> all{
      slow_line(),
      {"simplest, sd 0.0225 deg", walker_in_gait(Walker::simplest, 0.0225, dynamics::Terrain::fresh)},
      {"compass, sd 0.211 deg", walker_in_gait(Walker::compass, 0.00368 / analysis::degree, dynamics::Terrain::fresh)}};
  const auto [repetitions, first_seed, first, last] = asked(argc, argv, 100, all.size());
  for (std::size_t i = first; i < last; ++i)
    compare(all[i], static_cast<std::uint64_t>(repetitions), static_cast<std::uint64_t>(first_seed));
}
