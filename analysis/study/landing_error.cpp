#include "analysis/study/landing_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

#include "analysis/statistics/interval_95.h"
#include "analysis/study/trial_study.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t replicates = 8;
constexpr std::size_t fine_draws = 128, rough_draws = 32;  // of a replicate
constexpr double rough_tolerance = 0.05;         // from it on rough draws do: their scatter is in the interval
constexpr std::uint32_t of_landings = 1u << 20;  // the first of their randomisations
constexpr double begins_at = 0.96;               // share of a study that is done
constexpr double spread = 2;                     // [sd] of the scores by which memory is looked for

// Interpolates expected steps between the states of a phase: straight lines.
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

// Makes plain draws that spread wider, with the weights that belong to that.
markov::Draws spread_draws(int dimension, markov::DrawOptions options) {
  options.weighting = markov::Weighting::plain;
  markov::Draws draws = markov::make_draws(dimension, options);
  double total = 0;
  for (std::size_t k = 0; k < draws.count(); ++k) {
    double squares = 0;
    for (int d = 0; d < dimension; ++d) {
      double& score = draws.score[k * static_cast<std::size_t>(dimension) + static_cast<std::size_t>(d)];
      squares += score * score;
      score *= spread;
    }
    total += draws.weight[k] = std::exp(-0.5 * (spread * spread - 1) * squares);
  }
  for (double& weight : draws.weight) weight /= total;
  return draws;
}

// Sums a defect over all events from the launch on: half of the draws are of the launch.
class Events {
 public:
  using Worth = std::function<double(double state)>;
  using Defect = std::function<double(double state, int phase, std::span<const double> score)>;

  Events(const Problem& problem, int phases, std::span<const double> states, const markov::SampledChain& sampled,
         const SolvedChain& solved, std::size_t draws_a_replicate)
      : problem_(problem),
        states_(states),
        solved_(solved),
        phases_(phases),
        per_phase_(states.size() / static_cast<std::size_t>(phases)),
        draws_a_replicate_(draws_a_replicate),
        visits_(solved.solver.solve_left(sampled.launch.after)) {
    std::partial_sum(visits_.begin(), visits_.end(), visits_.begin());
  }

  // Returns the worth of the states at a phase, in steps.
  Worth worth(int phase) const {
    const std::size_t first = static_cast<std::size_t>(phase % phases_) * per_phase_;
    return Between(states_.subspan(first, per_phase_),
                   std::span<const double>(solved_.mean).subspan(first, per_phase_));
  }

  // Returns the defect of every randomisation, relative to the expected steps from the launch; every draw is written to
  // its place, so that threads change no bit.
  std::vector<double> sum(const std::vector<markov::Draws>& draws, const StudyOptions& options,
                          const Defect& defect) const {
    const auto dimension = static_cast<std::size_t>(draws.front().dimension);
    std::vector<double> part(draws.size() * draws_a_replicate_);
    const double all_visits = visits_.back();
    const auto follow = [&](std::size_t task) {
      const std::size_t k = task % draws_a_replicate_, r = task / draws_a_replicate_;
      const markov::Draws& of = draws[r];
      const auto score = std::span(of.score).subspan(k * dimension, dimension);
      if (r < replicates) {
        const auto at = std::upper_bound(visits_.begin(), visits_.end(), of.offset[k] * all_visits) - visits_.begin();
        const auto i = std::min(static_cast<std::size_t>(at), visits_.size() - 1);
        part[task] = of.weight[k] * all_visits * defect(states_[i], static_cast<int>(i / per_phase_), score);
      } else {
        const double state = problem_.launch.state(markov::normal_score(of.offset[k]));
        part[task] = of.weight[k] * defect(state, problem_.launch.phase, score);
      }
    };
    markov::parallel_for(part.size(), options.threads, follow, progress_of(options));
    std::vector<double> change(replicates);
    for (std::size_t task = 0; task < part.size(); ++task)
      change[task / draws_a_replicate_ % replicates] += part[task] / solved_.from_start;
    return change;
  }

 private:
  // Landings that are followed may take long: whoever listens may stop them.
  static markov::Share progress_of(const StudyOptions& options) {
    if (!options.progress) return {};
    return [&options](double share) {
      options.progress(begins_at + (before_trials - begins_at) * share, "landings followed beside the table");
    };
  }

  const Problem& problem_;
  std::span<const double> states_;
  const SolvedChain& solved_;
  int phases_;
  std::size_t per_phase_, draws_a_replicate_;
  std::vector<double> visits_;  // summed up
};

}  // namespace

LandingError landing_error(const Problem& problem, int phases, std::span<const double> states,
                           const markov::SampledChain& sampled, const SolvedChain& solved,
                           const StudyOptions& options) {
  const markov::AnyReturnMap& map = problem.map;
  const int dimension = map.noise_dimension();
  const std::vector<double> no_noise(static_cast<std::size_t>(2 * dimension), 0.0);
  const auto nothing = [](double) { return 0.0; };
  const std::size_t draws_a_replicate = options.tolerance < rough_tolerance ? fine_draws : rough_draws;
  const auto draws = [&](auto&& make, int scores) {
    std::vector<markov::Draws> all;
    for (std::size_t r = 0; r < 2 * replicates; ++r)
      all.push_back(make(scores, markov::DrawOptions{.count = draws_a_replicate,
                                                     .seed = options.seed,
                                                     .replicate = static_cast<std::uint32_t>(of_landings + r),
                                                     .tail = options.tail}));
    return all;
  };
  const Events events(problem, phases, states, sampled, solved, draws_a_replicate);
  LandingError error;
  if (map.landing_defect(states[0], 0, std::span(no_noise).first(static_cast<std::size_t>(dimension)), nothing)) {
    const TInterval change = t_interval(events.sum(
        draws(markov::make_draws, dimension), options, [&](double state, int phase, std::span<const double> score) {
          return *map.landing_defect(state, phase, score, events.worth(phase + 1));
        }));
    const double first_order = std::abs(change.mean) + change.half_width;
    error.table = first_order + 2 * first_order * first_order;
  }
  if (map.memory_defect(states[0], 0, no_noise, nothing)) {
    const TInterval change = t_interval(events.sum(
        draws(spread_draws, 2 * dimension), options, [&](double state, int phase, std::span<const double> score) {
          return *map.memory_defect(state, phase, score, events.worth(phase + 2));
        }));
    const double half = change.half_width + change.mean * change.mean;
    error.memory = {change.mean, change.mean - half, change.mean + half};
  }
  return error;
}

LandingReach landing_reach(const StepsToRest& steps) {
  return {steps.landing_error - std::min(0.0, steps.memory.lower),
          steps.landing_error + std::max(0.0, steps.memory.upper)};
}

void add_landing_error(Metastability& result, const LandingError& error, double tolerance) {
  result.steps.landing_error = error.table;
  result.steps.memory = error.memory;
  const auto [less, more] = landing_reach(result.steps);
  const double memory = std::max(std::abs(error.memory.lower), std::abs(error.memory.upper));
  if (less == 0 && more == 0) return;
  for (Estimate* steps : {&result.steps.from_start, &result.steps.from_quasi_stationary, &result.steps.worst_start}) {
    steps->lower = std::min(steps->value, std::max(1.0, steps->lower * std::exp(-less)));
    steps->upper *= std::exp(more);
  }
  result.steps.widen_reach_end(less, more);
  Estimate& rate = result.spectrum.failure_rate;
  rate.lower *= std::exp(-more);
  rate.upper = std::max(rate.value, std::min(1.0, rate.upper * std::exp(less)));
  if (std::max(less, more) <= tolerance || result.status != Status::converged) return;
  result.status = Status::tolerance_not_met;
  result.message = fmt::format("tolerance {} not met: landings read from a table may move the expected steps by {:.2g}",
                               tolerance, error.table);
  if (memory > 0)
    result.message +=
        fmt::format(", and what the state of the chain leaves out moves them by {:.2g} to {:.2g} (in the interval)",
                    error.memory.lower, error.memory.upper);
}

}  // namespace metastable::analysis
