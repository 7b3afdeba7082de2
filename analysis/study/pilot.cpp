#include "analysis/study/pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/study/consistency.h"
#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t pilot_cells = 96;
constexpr std::size_t pilot_samples = 4096;
constexpr double beyond_regime = 1e-13;  // share of the survivors
constexpr double held = 1e-10;           // share of the survivors in the highest cells: the cells hold the others
constexpr double farthest_reach = 1e6;   // of the cells, in widths of the bulk of a step's landings
// The share of the survivors in the highest cells, at that reach, from which there is no regime: a tenth of them is
// then a million widths away from where the others are. Convention: a wheel that flies faster and faster has 54 %, feet
// that nothing but a chance in a thousand lets go on have 0.1 %.
constexpr double without_end = 0.1;

// Finds the lowest state with less than 1e-13 of the survivors above it, at any phase.
double top_of(const markov::StateSpace& space, const std::vector<double>& nu) {
  double top = 0;
  for (int p = 0; p < space.phases(); ++p) {
    double above = 0;
    std::size_t cell = space.cells();
    while (cell > 1 && (above += nu[space.index(p, cell - 1)]) <= beyond_regime) --cell;
    top = std::max(top, space.grid(p).lower(cell - 1) + space.grid(p).width(cell - 1));
  }
  return top;
}

// Counts expected visits to each state in the steps after the launch: the transient that cells must hold in
// every phase.
std::vector<double> early_visits(const markov::SampledChain& sampled) {
  constexpr int steps = 64;
  std::vector<double> now = sampled.launch.after, visits = now;
  for (int step = 1; step < steps; ++step) {
    now = markov::apply_left(sampled.chain, now);
    for (std::size_t i = 0; i < visits.size(); ++i) visits[i] += now[i];
  }
  return visits;
}

}  // namespace

std::vector<std::uint32_t> Pilot::regime(const markov::StateSpace& cells) const {
  std::vector<std::uint32_t> states;
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (cells.grid(cells.phase(i)).lower(cells.cell(i)) < regime_top) states.push_back(static_cast<std::uint32_t>(i));
  if (states.size() == cells.size()) states.clear();
  return states;
}

std::size_t with_launch(const Problem& problem, std::size_t cells, std::uint64_t seed) {
  return static_cast<std::size_t>(
      std::ceil(static_cast<double>(cells) * markov::launch_cells(problem.map, problem.launch, seed)));
}

std::optional<Pilot> solve_pilot(const Problem& problem, const StudyOptions& options, bool beside) {
  const std::size_t cells = with_launch(problem, pilot_cells, options.seed);
  for (double reach = 1.2;; reach *= reach > 3 ? 10 : 1.5) {
    markov::StateSpace space = markov::covering_space(problem.map, problem.launch, cells, options.seed, reach);
    markov::SampledChain sampled =
        markov::discretize(problem.map, space, problem.launch,
                           {.draws = draw_options(options, pilot_samples, 0), .threads = options.threads});
    if (beside) {
      if (sampled.launch.rest == 1) return std::nullopt;
      sampled = without_unreached(std::move(sampled));
    }
    if (!rests(sampled)) return std::nullopt;
    const markov::ChainSolver solver(sampled.chain);
    const markov::QuasiStationary quasi = markov::quasi_stationary(solver, markov::FewSurvivors::unsettled);
    const std::vector<double> nu = markov::shares_in_classes(solver.period(), quasi.distribution);
    const double beyond = markov::top_share(space, nu);
    if (reach > farthest_reach && beyond > without_end) {
      const markov::Grid& grid = space.grid(0);
      throw WithoutRegime(fmt::format(
          "survivors gain from step to step without end: {:.3g} % of them come to {} above {:.3g}{}, so that there is "
          "no metastable regime, and the expected steps are infinite or of no wheel that steps from foot to foot",
          100 * beyond, problem.observed, problem.observable(grid.lower(space.cells() - 1)), problem.observed_unit));
    }
    if (beyond < held || reach > farthest_reach)
      return Pilot{space,
                   nu,
                   quasi.survival_weight,
                   early_visits(sampled),
                   beside,
                   cells > pilot_cells ? top_of(space, nu) : infinite};
  }
}

StudyOptions deep_enough(StudyOptions options, double failure_rate) {
  while (options.tail > 1e-300 && std::log(failure_rate) < 0.6 * std::log(options.tail))
    options.tail = std::max(1e-300, options.tail * options.tail * options.tail);
  return options;
}

markov::DrawOptions draw_options(const StudyOptions& options, std::size_t samples, int replicate) {
  return {.count = samples,
          .seed = options.seed,
          .replicate = static_cast<std::uint32_t>(replicate),
          .sequence = options.sequence,
          .weighting = options.weighting,
          .tail = options.tail};
}

bool rests(const markov::SampledChain& sampled) {
  const markov::Reachability reach = markov::classify(sampled.chain);
  return std::all_of(reach.must_rest.begin(), reach.must_rest.end(), [](auto yes) { return yes != 0; });
}

bool never_rests(const markov::SampledChain& sampled) {
  const markov::Reachability reach = markov::classify(sampled.chain);
  return std::any_of(reach.can_rest.begin(), reach.can_rest.end(), [](auto yes) { return yes == 0; });
}

markov::SampledChain without_unreached(markov::SampledChain sampled) {
  const markov::Chain& chain = sampled.chain;
  const markov::Reachability reach = markov::classify(chain);
  const std::vector<std::uint8_t> met = markov::reachable_from(chain, sampled.launch.after);
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(chain.kill().begin(), chain.kill().end());
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (met[i] || reach.must_rest[i]) {
      column.insert(column.end(), chain.columns(i).begin(), chain.columns(i).end());
      value.insert(value.end(), chain.values(i).begin(), chain.values(i).end());
    } else {
      kill[i] = 1;
    }
    row_start.push_back(value.size());
  }
  sampled.chain = markov::Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill));
  return sampled;
}

}  // namespace metastable::analysis
