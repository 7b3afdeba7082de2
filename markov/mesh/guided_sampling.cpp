#include "markov/mesh/guided_sampling.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/score_lattice.h"
#include "markov/parallel.h"
#include "markov/rows/draws.h"

namespace metastable::markov {
namespace {

constexpr std::uint64_t kBurnIn = 0x3000, kOffsets = 0x4000, kChoices = 0x5000;
constexpr double kDefensive = 0.05;  // share of the guide's mean that every score gets

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

  double sample(std::uint64_t number) const {
    std::vector<double> state = settled(number);
    const std::size_t d = state.size(), m = lattice_.size(), s = static_cast<std::size_t>(map_.scores);
    std::vector<double> states(m * d), scores(m * s), weights(m), next(m * d), worth(m);
    std::vector<std::uint8_t> failed(m);
    double weight = 1;
    for (int left = window_;; --left) {
      const int phase = (burn_in(number) + window_ - left) % map_.phases;
      for (std::size_t i = 0; i < m; ++i)
        std::copy(state.begin(), state.end(), states.begin() + static_cast<std::ptrdiff_t>(i * d));
      std::vector<double> offset;
      for (std::size_t k = 0; k < s; k += 4) {
        const auto u = uniforms(options_.seed, kOffsets + k / 4, number, static_cast<std::uint64_t>(left));
        offset.insert(offset.end(), u.begin(),
                      u.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, s - k)));
      }
      lattice_.place(offset, scores, weights);
      std::fill(failed.begin(), failed.end(), 0);
      checked_step(map_, phase, states, scores, next, failed);
      if (left == 0) {
        double fails = 0;
        for (std::size_t i = 0; i < m; ++i) fails += failed[i] ? weights[i] : 0;
        return weight * fails;
      }
      const auto& guide = guide_[static_cast<std::size_t>(left - 1)];
      double all = 0, mean = 0;
      for (std::size_t i = 0; i < m; ++i) {
        worth[i] = 0;
        if (failed[i]) continue;
        const auto corners = mesh_.corners((phase + 1) % map_.phases, std::span(next).subspan(i * d, d));
        for (int c = 0; c < corners.count; ++c)
          worth[i] += corners.weight[static_cast<std::size_t>(c)] * guide[corners.node[static_cast<std::size_t>(c)]];
        mean += weights[i] * worth[i];
        all += weights[i];
      }
      if (!(mean > 0)) return 0;  // nothing near leads to failure in time, so far as the mesh knows
      double total = 0;
      for (std::size_t i = 0; i < m; ++i) {
        worth[i] = failed[i] ? 0 : worth[i] + kDefensive * mean / all;
        total += weights[i] * worth[i];
      }
      double at = total * uniforms(options_.seed, kChoices, number, static_cast<std::uint64_t>(left))[0];
      std::size_t chosen = m;
      for (std::size_t i = 0; i < m && at >= 0; ++i) {
        if (worth[i] == 0) continue;
        chosen = i;
        at -= weights[i] * worth[i];
      }
      weight *= total / worth[chosen];
      std::copy_n(next.begin() + static_cast<std::ptrdiff_t>(chosen * d), d, state.begin());
    }
  }

 private:
  int burn_in(std::uint64_t number) const {
    return options_.burn_in + static_cast<int>(number % static_cast<std::uint64_t>(map_.phases));
  }

  std::vector<double> settled(std::uint64_t number) const {
    const auto s = static_cast<std::size_t>(map_.scores);
    std::vector<double> state = start_, next(start_.size()), scores(s);
    std::uint64_t attempt = 0;
    for (int step = 0; step < burn_in(number); ++step) {
      for (std::size_t k = 0; k < s; ++k)
        scores[k] = normal_score(
            uniforms(options_.seed, kBurnIn + k, number, attempt * 0x10000 + static_cast<std::uint64_t>(step))[0]);
      std::uint8_t failed = 0;
      checked_step(map_, step % map_.phases, state, scores, next, {&failed, 1});
      if (failed) {
        if (++attempt > 100000) throw MapError("guided sampling: no walker survives the burn-in");
        state = start_;
        step = -1;
      } else {
        state.swap(next);
      }
    }
    return state;
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
  std::vector<double> weight(options.samples);
  constexpr std::size_t share = 16;
  parallel_for((options.samples + share - 1) / share, options.threads, [&](std::size_t part) {
    for (std::size_t i = part * share; i < std::min(options.samples, (part + 1) * share); ++i)
      weight[i] = guided.sample(i);
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

}  // namespace metastable::markov
