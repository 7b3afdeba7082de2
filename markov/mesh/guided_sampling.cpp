#include "markov/mesh/guided_sampling.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "markov/mesh/mesh_passage.h"
#include "markov/parallel.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::uint64_t burn_in_stream = 0x3000, offsets_stream = 0x4000, choices_stream = 0x5000;
constexpr double defensive = 0.05;   // share of the guide's mean that every score gets
constexpr double unsampled = 1e-4;   // of the failures: what scores beyond their reach may stand for
constexpr double about_equal = 0.2;  // sd over mean of the chances to fail after a window: it adds 4 % to the variance

class Guided {
 public:
  Guided(const BatchMap& map, const Mesh& mesh, std::span<const double> start, const GuidedOptions& options)
      : map_(map),
        mesh_(mesh),
        start_(start.begin(), start.end()),
        options_(options),
        lattice_(map.scores, options.score_spacing, options.score_reach) {
    window_ = (options.window + map.phases - 1) / map.phases * map.phases;
    guide_ = failure_in_step(mesh, window_);
  }

  /// Says how many samples go side by side: few steps of many states take a simulator less time than many of one.
  std::size_t together() const {
    return map_.dear ? std::max<std::size_t>(1, rows_of_a_dear_call / lattice_.size())
                     : std::clamp<std::size_t>(4096 / lattice_.size(), 1, 64);
  }

  /// Writes the weights of the samples `first`, `first` + phases, ..., which meet the same phase in each step.
  /// @param state  of each after its burn-in
  void sample(std::uint64_t first, std::vector<double> state, std::span<double> weight) const {
    const std::size_t d = start_.size(), m = lattice_.size(), s = static_cast<std::size_t>(map_.scores);
    std::vector<double> states, scores, weights, next;
    std::vector<std::uint8_t> failed;
    std::vector<std::size_t> led(weight.size());  // those that the mesh can lead to failure
    std::iota(led.begin(), led.end(), std::size_t{0});
    std::fill(weight.begin(), weight.end(), 1.0);
    for (int left = window_; !led.empty(); --left) {
      const std::size_t rows = led.size() * m;
      states.resize(rows * d), scores.resize(rows * s), weights.resize(rows), next.resize(rows * d);
      failed.assign(rows, 0);
      for (std::size_t k = 0; k < led.size(); ++k) {
        for (std::size_t i = k * m; i < (k + 1) * m; ++i) std::copy_n(&state[led[k] * d], d, &states[i * d]);
        lattice_.place(offset(number(first, led[k]), left), std::span(scores).subspan(k * m * s, m * s),
                       std::span(weights).subspan(k * m, m));
      }
      checked_step(map_, (burn_in(first) + window_ - left) % map_.phases, states, scores, next, failed);
      std::size_t kept = 0;
      for (std::size_t k = 0; k < led.size(); ++k) {
        const Fan fan{std::span(weights).subspan(k * m, m), std::span(next).subspan(k * m * d, m * d),
                      std::span(failed).subspan(k * m, m)};
        double& w = weight[led[k]];
        w *= left == 0 ? failing(fan) : take(fan, number(first, led[k]), left, std::span(state).subspan(led[k] * d, d));
        if (w > 0) led[kept++] = led[k];
      }
      if (left == 0) return;
      led.resize(kept);
    }
  }

  /// Returns the states of these samples after their burn-in; a sample that failed begins again.
  std::vector<double> settled(std::uint64_t first, std::size_t count) const {
    const std::size_t d = start_.size(), s = static_cast<std::size_t>(map_.scores);
    std::vector<double> state, states, scores, next;
    for (std::size_t k = 0; k < count; ++k) state.insert(state.end(), start_.begin(), start_.end());
    std::vector<int> step(count, 0);
    std::vector<std::uint64_t> attempt(count, 0);
    std::vector<std::uint8_t> failed;
    std::vector<std::size_t> walking;
    const int last = burn_in(first);
    for (int phase = 0; std::any_of(step.begin(), step.end(), [&](int n) { return n < last; });
         phase = (phase + 1) % map_.phases) {
      walking.clear(), states.clear(), scores.clear();
      for (std::size_t k = 0; k < count; ++k) {
        if (step[k] == last || step[k] % map_.phases != phase) continue;
        walking.push_back(k);
        states.insert(states.end(), &state[k * d], &state[k * d] + d);
        for (std::size_t j = 0; j < s; ++j)
          scores.push_back(normal_score(uniforms(options_.seed, burn_in_stream + j, number(first, k),
                                                 attempt[k] * 0x10000 + static_cast<std::uint64_t>(step[k]))[0]));
      }
      if (walking.empty()) continue;
      next.resize(states.size());
      failed.assign(walking.size(), 0);
      checked_step(map_, phase, states, scores, next, failed);
      for (std::size_t i = 0; i < walking.size(); ++i) {
        const std::size_t k = walking[i];
        const double* const to = failed[i] ? start_.data() : &next[i * d];
        std::copy_n(to, d, &state[k * d]);
        step[k] = failed[i] ? 0 : step[k] + 1;
        if (failed[i] && ++attempt[k] > 100000) throw MapError("guided sampling: no walker survives the burn-in");
      }
    }
    return state;
  }

 private:
  /// Says where a lattice of scores leads from one state.
  struct Fan {
    std::span<const double> weight, next;
    std::span<const std::uint8_t> failed;
  };

  std::uint64_t number(std::uint64_t first, std::size_t k) const {
    return first + k * static_cast<std::uint64_t>(map_.phases);
  }

  int burn_in(std::uint64_t number) const {
    return options_.burn_in + static_cast<int>(number % static_cast<std::uint64_t>(map_.phases));
  }

  std::vector<double> offset(std::uint64_t number, int left) const {
    std::vector<double> offset;
    const auto s = static_cast<std::size_t>(map_.scores);
    for (std::size_t k = 0; k < s; k += 4) {
      const auto u = uniforms(options_.seed, offsets_stream + k / 4, number, static_cast<std::uint64_t>(left));
      offset.insert(offset.end(), u.begin(), u.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, s - k)));
    }
    return offset;
  }

  static double failing(const Fan& fan) {
    double fails = 0;
    for (std::size_t i = 0; i < fan.weight.size(); ++i) fails += fan.failed[i] ? fan.weight[i] : 0;
    return fails;
  }

  /// Takes one of the landings for the next state. Returns its probability over that with which it was taken; 0 if
  /// nothing near leads to failure in time, so far as the mesh knows.
  double take(const Fan& fan, std::uint64_t number, int left, std::span<double> state) const {
    const std::size_t d = state.size(), m = fan.weight.size();
    const int phase = (burn_in(number) + window_ - left + 1) % mesh_.phases();
    const auto& guide = guide_[static_cast<std::size_t>(left - 1)];
    std::vector<double> worth(m, 0.0);
    double all = 0, mean = 0;
    for (std::size_t i = 0; i < m; ++i) {
      if (fan.failed[i]) continue;
      const auto corners = mesh_.corners(phase, fan.next.subspan(i * d, d));
      for (int c = 0; c < corners.count; ++c)
        worth[i] += corners.weight[static_cast<std::size_t>(c)] * guide[corners.node[static_cast<std::size_t>(c)]];
      mean += fan.weight[i] * worth[i];
      all += fan.weight[i];
    }
    if (!(mean > 0)) return 0;
    double total = 0;
    for (std::size_t i = 0; i < m; ++i) {
      worth[i] = fan.failed[i] ? 0 : worth[i] + defensive * mean / all;
      total += fan.weight[i] * worth[i];
    }
    double at = total * uniforms(options_.seed, choices_stream, number, static_cast<std::uint64_t>(left))[0];
    std::size_t chosen = m;
    for (std::size_t i = 0; i < m && at >= 0; ++i) {
      if (worth[i] == 0) continue;
      chosen = i;
      at -= fan.weight[i] * worth[i];
    }
    std::copy_n(&fan.next[chosen * d], d, state.begin());
    return total / worth[chosen];
  }

  const BatchMap& map_;
  const Mesh& mesh_;
  std::vector<double> start_;
  GuidedOptions options_;
  ScoreLattice lattice_;
  int window_ = 0;
  std::vector<std::vector<double>> guide_;
};

}  // namespace

GuidedRate guided_failure_rate(const BatchMap& map, const Mesh& mesh, std::span<const double> start,
                               const GuidedOptions& options) {
  require_start(map, start);
  if (options.samples < 16 || options.window < 1 || options.burn_in < 0 || options.burn_in >= 0x10000)
    throw std::invalid_argument(fmt::format(
        "guided sampling: {} samples (16 or more), a window of {} steps (1 or more), a burn-in of {} (0 to 65535)",
        options.samples, options.window, options.burn_in));
  const Guided guided(map, mesh, start, options);
  // Samples that meet the same phases stand side by side; of a dear map all of them while they walk in.
  const auto phases = static_cast<std::size_t>(map.phases), share = guided.together();
  const std::size_t walking = map.dear ? std::max(share, rows_of_a_dear_call / share * share) : share;
  std::vector<double> weight(options.samples);
  parallel_for((options.samples + walking * phases - 1) / (walking * phases) * phases, options.threads,
               [&](std::size_t part) {
                 const std::size_t begin = part / phases * walking * phases + part % phases;
                 if (begin >= options.samples) return;
                 const std::size_t all = std::min(walking, (options.samples - begin + phases - 1) / phases);
                 const std::vector<double> state = guided.settled(begin, all);
                 for (std::size_t from = 0; from < all; from += share) {
                   std::vector<double> some(std::min(share, all - from));
                   const auto at = state.begin() + static_cast<std::ptrdiff_t>(from * start.size());
                   guided.sample(begin + from * phases,
                                 {at, at + static_cast<std::ptrdiff_t>(some.size() * start.size())}, some);
                   for (std::size_t k = 0; k < some.size(); ++k) weight[begin + (from + k) * phases] = some[k];
                 }
               });
  GuidedRate rate;
  rate.samples = options.samples;
  const auto n = static_cast<double>(options.samples);
  double squares = 0, spread = 0;
  for (const double w : weight) {
    rate.rate += w / n;
    squares += w * w;
  }
  for (const double w : weight) spread += (w - rate.rate) * (w - rate.rate);
  rate.standard_error = std::sqrt(spread / (n - 1) / n);
  rate.effective_samples = squares > 0 ? rate.rate * n * rate.rate * n / squares : 0;
  // They have walked on for the window's steps: weights estimate rate (1 - rate)^window,
  // and of two such rates the smaller is meant.
  const int walked = (options.window + map.phases - 1) / map.phases * map.phases;
  double survive = 1;
  for (int i = 0; i < 100; ++i) survive = std::exp(walked * std::log1p(-std::min(0.5, rate.rate / survive)));
  rate.standard_error /= survive;
  rate.rate /= survive;
  return rate;
}

int reaching_window(const Mesh& mesh, std::span<const double> settled, int most) {
  if (settled.empty()) return most;
  const std::vector<std::vector<double>> fails = failure_in_step(mesh, most);
  for (int window = 1; window < most; ++window) {
    const std::vector<double>& chance = fails[static_cast<std::size_t>(window)];
    std::vector<double> mass(static_cast<std::size_t>(mesh.phases()), 0.0), mean = mass, square = mass;
    for (std::size_t i = 0; i < mesh.size(); ++i) {
      const auto phase = static_cast<std::size_t>(mesh.phase(i));
      mass[phase] += settled[i];
      mean[phase] += settled[i] * chance[i];
      square[phase] += settled[i] * chance[i] * chance[i];
    }
    bool even = true;
    for (std::size_t p = 0; p < mean.size(); ++p)
      even = even && square[p] * mass[p] <= (1 + about_equal * about_equal) * mean[p] * mean[p];
    if (even) return window;
  }
  return most;
}

double sampled_reach(int scores, int window, double rate) {
  const double beyond = std::clamp(unsampled * rate / window, 1e-300, 0.5);
  const double reach = std::sqrt(2 * boost::math::gamma_q_inv(0.5 * scores, beyond));
  const GuidedOptions most;  // whose lattice is moved by half a spacing on every axis
  return std::min(most.score_reach, reach + 0.5 * most.score_spacing * std::sqrt(static_cast<double>(scores)));
}

}  // namespace metastable::markov
