#include "markov/mesh/batch_simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "markov/normal_95.h"
#include "markov/parallel.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::size_t trials_together = 128;  // trials followed side by side
constexpr std::uint64_t stream = 0x2000;

/// Follows trials first .. first + count - 1 to their failures, `longest` steps at most; stops early once `spent`
/// exceeds the limit of all.
void follow(const BatchMap& map, std::span<const double> start, const SimulationOptions& options, std::uint64_t longest,
            std::size_t first, std::span<std::uint64_t> steps, std::atomic<std::uint64_t>& spent) {
  const auto d = static_cast<std::size_t>(map.dimension), s = static_cast<std::size_t>(map.scores);
  std::vector<std::size_t> trial(steps.size());
  std::vector<double> states, scores, next;
  std::vector<std::uint64_t> words;
  std::vector<std::uint8_t> failed;
  for (std::size_t i = 0; i < trial.size(); ++i) {
    trial[i] = first + i;
    states.insert(states.end(), start.begin(), start.end());
  }
  for (std::uint64_t number = 1; !trial.empty() && number <= longest; ++number) {
    const int phase = static_cast<int>((number - 1) % static_cast<std::uint64_t>(map.phases));
    next.resize(states.size());
    failed.assign(trial.size(), 0);
    if (map.scores > 0) {
      scores.resize(trial.size() * s);
      for (std::size_t i = 0; i < trial.size(); ++i)
        for (std::size_t k = 0; k < s; k += 4) {
          const auto u = uniforms(options.seed, stream + k / 4, trial[i], number);
          for (std::size_t j = k; j < std::min(s, k + 4); ++j) scores[i * s + j] = normal_score(u[j - k]);
        }
      checked_step(map, phase, states, scores, next, failed);
    } else {
      words.resize(trial.size());
      for (std::size_t i = 0; i < trial.size(); ++i) words[i] = random_words(options.seed, stream, trial[i], number)[0];
      checked_draw(map, phase, states, words, next, failed);
    }
    if ((spent += trial.size()) > options.most_steps) return;
    std::size_t left = 0;
    for (std::size_t i = 0; i < trial.size(); ++i) {
      if (failed[i]) {
        steps[trial[i] - first] = number;
        continue;
      }
      trial[left] = trial[i];
      std::copy_n(next.data() + i * d, d, states.data() + left++ * d);
    }
    trial.resize(left);
    states.resize(left * d);
  }
}

/// Returns whether all trials were followed before the limit on their steps.
bool follow_all(const BatchMap& map, std::span<const double> start, std::uint64_t longest,
                const SimulationOptions& options, std::vector<std::uint64_t>& steps) {
  require_start(map, start);
  if (options.trials < 2)
    throw std::invalid_argument(fmt::format("simulation: {} trials, 2 or more expected", options.trials));
  steps.assign(options.trials, 0);
  std::atomic<std::uint64_t> spent = 0;
  const std::size_t together = map.dear ? rows_of_a_dear_call : trials_together;
  parallel_for((options.trials + together - 1) / together, options.threads, [&](std::size_t share) {
    const std::size_t first = share * together, count = std::min(together, options.trials - first);
    if (spent <= options.most_steps)
      follow(map, start, options, longest, first, std::span(steps).subspan(first, count), spent);
  });
  return spent <= options.most_steps;
}

}  // namespace

std::optional<SimulatedSteps> simulate_steps(const BatchMap& map, std::span<const double> start,
                                             const SimulationOptions& options) {
  std::vector<std::uint64_t> steps;
  if (!follow_all(map, start, std::numeric_limits<std::uint64_t>::max(), options, steps)) return std::nullopt;
  return summarize_steps(std::move(steps));
}

SimulatedSteps summarize_steps(std::vector<std::uint64_t> steps) {
  SimulatedSteps simulated;
  simulated.trials = steps.size();
  const auto n = static_cast<double>(steps.size());
  double squares = 0;
  for (const std::uint64_t s : steps) simulated.mean += static_cast<double>(s);
  simulated.mean /= n;
  for (const std::uint64_t s : steps) squares += std::pow(static_cast<double>(s) - simulated.mean, 2);
  simulated.standard_error = std::sqrt(squares / (n - 1) / n);
  simulated.steps = std::move(steps);
  return simulated;
}

std::vector<std::uint64_t> follow_walks(const BatchMap& map, std::span<const double> start, std::uint64_t longest,
                                        const SimulationOptions& options) {
  SimulationOptions unlimited = options;
  unlimited.most_steps = std::numeric_limits<std::uint64_t>::max();
  std::vector<std::uint64_t> steps;
  follow_all(map, start, longest, unlimited, steps);
  return steps;
}

std::string simulated_beside(const BatchMap& map, std::span<const double> start,
                             const std::vector<std::uint64_t>& walked, std::uint64_t longest,
                             const SimulationOptions& options) {
  constexpr double enough_failed = 20, most = 4096;  // trials leave 1.6 % of their mean
  constexpr std::uint64_t unforeseen = 2;            // times the steps that are foreseen from the walks
  double failed = 0, steps = 0;
  for (const std::uint64_t n : walked) {
    failed += n > 0;
    steps += static_cast<double>(n > 0 ? n : longest);
  }
  const double trials = failed < enough_failed ? 0 : static_cast<double>(options.most_steps) / (steps / failed);
  if (trials < static_cast<double>(fewest_trials)) return "";
  SimulationOptions asked = options;
  asked.trials = static_cast<std::size_t>(std::min(trials, most));
  asked.most_steps = unforeseen * options.most_steps;
  const std::optional<SimulatedSteps> alone = simulate_steps(map, start, asked);
  if (!alone) return "";
  const double half = normal_95 * alone->standard_error;
  return fmt::format("; {} simulated trials fail after {:.4g} steps in the mean (95 % interval {:.4g} to {:.4g})",
                     alone->trials, alone->mean, alone->mean - half, alone->mean + half);
}

std::pair<std::string, bool> walks_in_words(const BatchMap& map, std::span<const double> start,
                                            const SimulationOptions& options) {
  SimulationOptions asked = options;
  asked.trials = std::clamp<std::size_t>(options.most_steps, 2, walk_count);
  const std::size_t walks = asked.trials;
  const std::uint64_t longest = std::max<std::uint64_t>(1, options.most_steps / walks);
  std::vector<std::uint64_t> walked = follow_walks(map, start, longest, asked);
  const auto lasting = static_cast<std::size_t>(std::count(walked.begin(), walked.end(), 0U));
  if (lasting == walks) return {fmt::format("none of {} simulated walks of {} steps fails", walks, longest), false};
  if (lasting > 0)
    return {fmt::format("{} of {} simulated walks fail within {} steps{}", walks - lasting, walks, longest,
                        simulated_beside(map, start, walked, longest, options)),
            true};
  const SimulatedSteps all = summarize_steps(std::move(walked));
  return {fmt::format("{} of {} simulated walks fail, after {:.4g} steps in the mean (standard error {:.2g})", walks,
                      walks, all.mean, all.standard_error),
          true};
}

}  // namespace metastable::markov
