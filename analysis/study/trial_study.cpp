#include "analysis/study/trial_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "analysis/statistics/interval_95.h"
#include "analysis/study/consistency.h"
#include "analysis/study/followed_study.h"
#include "markov/parallel.h"
#include "markov/transition_rows/draws.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t checked_trials = 4096, checked_steps = 64;
constexpr double surprising = 4;     // standard errors
constexpr double few_failures = 16;  // a count of as many is normal: 4 standard errors reach to none
constexpr std::size_t unresolved_trials = 64, unresolved_steps = 2000;
constexpr double most_events = 2e7, most_rolled = 2e5;  // of a trial study: by the map, by Problem::follow
constexpr std::uint32_t of_trials = 1u << 24;           // the first of their randomisations
constexpr std::size_t first_trials = 4096, most_trials = 1u << 20;

// Holds trials that were followed, at most so many events each.
struct Trials {
  std::vector<double> steps;
  bool all_rest = true;
  double events = 0;
};

// Follows trials first .. first + count - 1. @param done  share of the study that is told while they are followed
Trials follow_trials(const Problem& problem, const StudyOptions& options, std::size_t first, std::size_t count,
                     std::size_t most, bool by_map, double done) {
  markov::Share told;
  if (options.progress) told = [&](double) { options.progress(done, "following trials"); };
  Trials trials;
  trials.steps.assign(count, 0.0);
  std::vector<std::uint8_t> rests(count);
  if (!by_map && problem.follow) {
    markov::parallel_for(
        count, options.threads,
        [&](std::size_t k) {
          // One event more than asked for: a trial that is cut off there has not rested within them.
          const std::uint64_t steps = problem.follow(options.seed, first + k, most + 1);
          rests[k] = steps <= most;
          trials.steps[k] = static_cast<double>(std::min<std::uint64_t>(steps, most));
        },
        told);
  } else {
    const auto dimension = static_cast<std::size_t>(problem.map.noise_dimension());
    constexpr std::size_t block = 256;  // trials that share a set of draws
    markov::parallel_for(
        (count + block - 1) / block, options.threads,
        [&](std::size_t b) {
          const std::size_t from = b * block, size = std::min(block, count - from);
          std::vector<double> state(size);
          std::vector<std::size_t> rolling(size);
          std::iota(rolling.begin(), rolling.end(), std::size_t{0});
          const markov::DrawOptions draws{.count = block,
                                          .seed = options.seed + 0x9e3779b97f4a7c15u * (first / block + b + 1),
                                          .replicate = of_trials,
                                          .sequence = markov::Sequence::random,
                                          .weighting = markov::Weighting::plain};
          const markov::Draws launch = markov::make_draws(1, draws);
          for (std::size_t k = 0; k < size; ++k) state[k] = problem.launch.state(launch.score[k]);
          for (std::size_t n = 0; n < most && !rolling.empty(); ++n) {
            markov::DrawOptions own = draws;
            own.replicate = of_trials + 1 + static_cast<std::uint32_t>(n);
            const markov::Draws noise = markov::make_draws(static_cast<int>(dimension), own);
            const int phase = static_cast<int>((static_cast<std::size_t>(problem.launch.phase) + n) %
                                               static_cast<std::size_t>(problem.map.phases()));
            std::erase_if(rolling, [&](std::size_t k) {
              ++trials.steps[from + k];
              const std::optional<double> next =
                  problem.map.landing(state[k], phase, std::span(noise.score).subspan(k * dimension, dimension));
              if (next) state[k] = *next;
              rests[from + k] = !next;
              return !next;
            });
          }
        },
        told);
  }
  for (std::size_t k = 0; k < count; ++k) {
    trials.all_rest = trials.all_rest && rests[k] != 0;
    trials.events += trials.steps[k];
  }
  return trials;
}

struct MeanError {
  double mean = 0, error = 0;
};
MeanError mean_of(const std::vector<double>& sample) {
  const auto n = static_cast<double>(sample.size());
  double mean = 0, square = 0;
  for (const double x : sample) mean += x / n;
  for (const double x : sample) square += (x - mean) * (x - mean);
  return {mean, std::sqrt(square / (n - 1) / n)};
}

}  // namespace

std::optional<Metastability> trial_study(const Problem& problem, const StudyOptions& options) {
  const double budget = problem.follow ? most_rolled : most_events;
  std::vector<double> steps;
  MeanError found;
  double events = 0, half = 0;
  for (std::size_t count = first_trials;; count = steps.size()) {
    const double done = std::min(0.9, events / budget);
    if (options.progress) options.progress(done, "following trials");
    const auto most = static_cast<std::size_t>((budget - events) / static_cast<double>(count) * 8);
    Trials more = follow_trials(problem, options, steps.size(), count, most, false, done);
    if (!more.all_rest) return std::nullopt;
    steps.insert(steps.end(), more.steps.begin(), more.steps.end());
    events += more.events;
    found = mean_of(steps);
    half = t_half_width(found.error, steps.size());
    if (half <= options.tolerance * found.mean || 2 * events > budget || steps.size() >= most_trials) break;
  }
  Metastability result;
  result.method = Method::followed;
  result.samples = steps.size();
  result.replicates = 1;
  result.phases = result.spectrum.period = problem.map.phases();
  result.steps.from_start = {found.mean, std::max(1.0, found.mean - half), found.mean + half};
  result.steps.sampling_error = half / found.mean;
  result.status = result.steps.sampling_error <= options.tolerance ? Status::converged : Status::tolerance_not_met;
  result.message =
      fmt::format("the noise is too narrow for cells of states: {} trials were followed instead", steps.size());
  if (result.status == Status::tolerance_not_met)
    result.message += fmt::format("; tolerance {} not met", options.tolerance);
  StepShares shares;
  for (const double one : steps) shares[one] += 1 / static_cast<double>(steps.size());
  fill_steps(problem, shares, result);
  if (options.reach_end_interval && problem.last_event)
    result.steps.reach_end_interval = exact_share(
        static_cast<std::size_t>(std::ranges::count_if(steps, [&](double one) { return one > *problem.last_event; })),
        steps.size());
  // Trials tell nothing of the regime: any rate is possible.
  result.spectrum.failure_rate = {1 / found.mean, 0, 1};
  result.steps.from_quasi_stationary = {found.mean, 1, infinite};
  result.steps.worst_start = {1, 1, infinite};
  result.survivors.mean = result.survivors.sd = undefined;
  result.survivors.restart_mean = result.survivors.restart_sd = undefined;
  return result;
}

void require_followed(const Problem& problem, const Metastability& study, const StudyOptions& options) {
  constexpr double much = 0.1;
  // An error of the whole, its square included, is no longer small, as both errors suppose.
  constexpr double beyond_first_order = 1;
  constexpr std::size_t launches = 4000;
  const Estimate& memory = study.steps.memory;
  const double moved = std::max({study.steps.landing_error, std::abs(memory.lower), std::abs(memory.upper)});
  if (!problem.follow || !(moved > much)) return;
  if (moved > beyond_first_order)
    throw StatesTooCoarse(fmt::format(
        "landings read from a table may move the expected steps by {:.2g} of themselves, and what a state at "
        "touch-down leaves out, such as feet that still hop or slide, by {:.2g} to {:.2g}: more than {} bounds "
        "nothing; simulate follows trials",
        study.steps.landing_error, memory.lower, memory.upper, beyond_first_order));
  const std::size_t most = study.steps.survival.size();
  const auto [mean, error] = mean_of(follow_trials(problem, options, 0, launches, most, false, before_trials).steps);
  const double expected = std::accumulate(study.steps.survival.begin(), study.steps.survival.end(), 0.0);
  const Estimate& all = study.steps.from_start;
  const double lower = expected * all.lower / all.value, upper = expected * all.upper / all.value;
  if (mean + surprising * error >= lower && mean - surprising * error <= upper) return;
  throw StatesTooCoarse(fmt::format(
      "of the first {} steps the chain of landings expects {:.4g} ({:.4g} to {:.4g}), and {} trials followed "
      "without it take {:.4g} (standard error {:.2g}): a state at touch-down leaves out too much here, such "
      "as feet that still hop or slide; simulate follows trials",
      most, expected, lower, upper, launches, mean, error));
}

Metastability held_against_trials(const Problem& problem, Metastability study, const StudyOptions& options) {
  if (study.method == Method::followed || study.status == Status::rest_unreachable) return study;
  if (study.status == Status::rest_unresolved) {
    const Trials trials = follow_trials(problem, options, 0, unresolved_trials, unresolved_steps, true, before_trials);
    if (!trials.all_rest) return study;
    std::optional<Metastability> answer = trial_study(problem, options);
    return answer ? *std::move(answer) : study;
  }
  const std::size_t most = std::min<std::size_t>(study.steps.survival.size(), checked_steps);
  const Trials trials = follow_trials(problem, options, 0, checked_trials, most, true, before_trials);
  const MeanError found = mean_of(trials.steps);
  const Estimate& all = study.steps.from_start;
  // Survival is that of the finest chain, whose own mean is not extrapolated. What that moves goes into the hazard
  // where failures may come at any step, and into the length of the walk where they come at its end: one of the two, or
  // between.
  double expected = 0, lower = 0, upper = 0, sum = 0, square = 0;
  for (std::size_t n = 0; n < most; ++n) {
    const double survival = std::max(0.0, study.steps.survival[n]);
    const auto with_mean = [&](double mean) { return std::pow(survival, study.steps.distribution.mean / mean); };
    expected += with_mean(all.value);
    lower += with_mean(all.lower);
    upper += with_mean(all.upper);
    sum += survival;
    square += static_cast<double>(2 * n + 1) * survival;
  }
  const auto longer = [&](double mean) {
    return std::min(sum * mean / study.steps.distribution.mean, static_cast<double>(most));
  };
  lower = std::min(lower, longer(all.lower)), upper = std::max(upper, longer(all.upper));
  // Trials may hold no failure where failures are rare: the chain then says how they scatter. One failure more or
  // less is no surprise where few are expected.
  const auto count = static_cast<double>(checked_trials);
  const double error = std::max(found.error, std::sqrt(std::max(0.0, square - sum * sum) / count));
  const bool few = count * (1 - study.steps.survival[most - 1]) < few_failures;
  const double slack = surprising * error + (few ? static_cast<double>(most) / count : 0);
  if (found.mean + slack >= lower && found.mean - slack <= upper) return study;
  if (std::optional<Metastability> answer = trial_study(problem, options)) {
    answer->steps.safe_state = study.steps.safe_state;
    return *std::move(answer);
  }
  study.status = Status::tolerance_not_met;
  study.message = fmt::format(
      "tolerance {} not met: of the first {} steps the chain expects {:.5g}, and {} trials followed one by one take "
      "{:.5g} (standard error {:.2g}): its cells are too wide for this noise (in the interval)",
      options.tolerance, most, expected, checked_trials, found.mean, error);
  Estimate& steps = study.steps.from_start;
  const Estimate before = steps;
  steps.lower = std::max(1.0, std::min(steps.lower, steps.value * (found.mean - slack) / expected));
  steps.upper = std::max(steps.upper, steps.value * (found.mean + slack) / expected);
  study.steps.widen_reach_end(std::log(before.lower / steps.lower), std::log(steps.upper / before.upper));
  return study;
}

}  // namespace metastable::analysis
