#include "analysis/study/pilot.h"

#include <algorithm>
#include <utility>

#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t pilot_cells = 96;
constexpr std::size_t pilot_samples = 4096;

// Expected visits to each state in the steps after the launch: the transient that the cells must hold in every phase.
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

std::optional<Pilot> solve_pilot(const Problem& problem, const StudyOptions& options) {
  for (double reach = 1.2;; reach *= reach > 3 ? 10 : 1.5) {
    markov::StateSpace space = markov::covering_space(problem.map, problem.launch, pilot_cells, options.seed, reach);
    const markov::SampledChain sampled =
        markov::discretize(problem.map, space, problem.launch,
                           {.draws = draw_options(options, pilot_samples, 0), .threads = options.threads});
    if (!rests(sampled)) return std::nullopt;
    const markov::ChainSolver solver(sampled.chain);
    const markov::QuasiStationary quasi = markov::quasi_stationary(solver);
    if (markov::top_share(space, quasi.distribution) < 1e-10 || reach > 1e6)
      return Pilot{std::move(space), quasi.distribution, quasi.survival_weight, early_visits(sampled)};
  }
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

}  // namespace metastable::analysis
