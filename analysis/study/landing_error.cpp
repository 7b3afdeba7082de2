#include "analysis/study/landing_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t replicates = 4;
constexpr std::size_t draws_a_replicate = 256;
constexpr std::uint32_t of_landings = 1u << 20;  // the first of their randomisations

// Expected steps between the states of a phase: straight lines.
class Between {
 public:
  Between(std::span<const double> states, std::span<const double> mean) : states_(states), mean_(mean) {}
  double operator()(double state) const {
    const auto above = std::upper_bound(states_.begin(), states_.end(), state) - states_.begin();
    const auto i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 1, std::ssize(states_) - 1));
    const double share = std::clamp((state - states_[i - 1]) / (states_[i] - states_[i - 1]), 0.0, 1.0);
    return mean_[i - 1] + share * (mean_[i] - mean_[i - 1]);
  }

 private:
  std::span<const double> states_, mean_;
};

}  // namespace

double landing_error(const Problem& problem, int phases, std::span<const double> states,
                     const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options) {
  const markov::AnyReturnMap& map = problem.map;
  const auto dimension = static_cast<std::size_t>(map.noise_dimension());
  const std::vector<double> no_noise(dimension, 0.0);
  if (!map.landing_defect(states[0], 0, no_noise, [](double) { return 1.0; })) return 0;
  const std::size_t per_phase = states.size() / static_cast<std::size_t>(phases);
  const auto defect = [&](double state, int phase, std::span<const double> score) {
    const std::size_t next = static_cast<std::size_t>((phase + 1) % phases) * per_phase;
    return *map.landing_defect(
        state, phase, score,
        Between(states.subspan(next, per_phase), std::span<const double>(solved.mean).subspan(next, per_phase)));
  };
  std::vector<double> visits = solved.solver.solve_left(sampled.launch.after);
  std::partial_sum(visits.begin(), visits.end(), visits.begin());
  const double all_visits = visits.back();
  // Half of the tasks are of the launch; every draw is written to its place, so that threads change no bit.
  std::vector<double> part(2 * replicates * draws_a_replicate);
  std::vector<markov::Draws> draws;
  for (std::size_t r = 0; r < 2 * replicates; ++r)
    draws.push_back(markov::make_draws(map.noise_dimension(), {.count = draws_a_replicate,
                                                               .seed = options.seed,
                                                               .replicate = static_cast<std::uint32_t>(of_landings + r),
                                                               .tail = options.tail}));
  markov::parallel_for(part.size(), options.threads, [&](std::size_t task) {
    const std::size_t k = task % draws_a_replicate;
    const markov::Draws& of = draws[task / draws_a_replicate];
    const auto score = std::span(of.score).subspan(k * dimension, dimension);
    if (task < replicates * draws_a_replicate) {
      const auto at = std::upper_bound(visits.begin(), visits.end(), of.offset[k] * all_visits) - visits.begin();
      const auto i = std::min(static_cast<std::size_t>(at), visits.size() - 1);
      part[task] = of.weight[k] * all_visits * defect(states[i], static_cast<int>(i / per_phase), score);
    } else {
      const double state = problem.launch.state(markov::normal_score(of.offset[k]));
      part[task] = of.weight[k] * defect(state, problem.launch.phase, score);
    }
  });
  std::array<double, replicates> change{};
  for (std::size_t task = 0; task < part.size(); ++task)
    change[task / draws_a_replicate % replicates] += part[task] / solved.from_start;
  const double mean = std::accumulate(change.begin(), change.end(), 0.0) / replicates;
  double squares = 0;
  for (const double one : change) squares += (one - mean) * (one - mean);
  return std::abs(mean) + 2 * std::sqrt(squares / (replicates * (replicates - 1)));
}

void add_landing_error(Metastability& result, double error, double tolerance) {
  result.steps.landing_error = error;
  if (error == 0) return;
  for (Estimate* steps : {&result.steps.from_start, &result.steps.from_quasi_stationary, &result.steps.worst_start}) {
    steps->lower = std::min(steps->value, std::max(1.0, steps->lower * std::exp(-error)));
    steps->upper *= std::exp(error);
  }
  Estimate& rate = result.spectrum.failure_rate;
  rate.lower *= std::exp(-error);
  rate.upper = std::max(rate.value, std::min(1.0, rate.upper * std::exp(error)));
  if (error <= tolerance || result.status != Status::converged) return;
  result.status = Status::tolerance_not_met;
  result.message = fmt::format("tolerance {} not met: landings read from a table may move the expected steps by {:.2g}",
                               tolerance, error);
}

}  // namespace metastable::analysis
