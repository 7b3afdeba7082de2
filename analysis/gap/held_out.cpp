#include "analysis/gap/held_out.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "analysis/fitting/effect_fit.h"
#include "analysis/statistics/random.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr int fold_steps = 3;                 // of a fit that starts from the optimum of all trials
constexpr std::uint64_t closing_draws = 400;  // of the bootstrap over trials

}  // namespace

std::vector<int> folds_of_trials(std::size_t trials, int folds, std::uint64_t seed) {
  std::vector<std::size_t> order(trials);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [seed](std::size_t a, std::size_t b) { return shuffling_key(seed, a) < shuffling_key(seed, b); });
  std::vector<int> fold(trials);
  for (std::size_t k = 0; k < trials; ++k) fold[order[k]] = static_cast<int>(k % static_cast<std::size_t>(folds));
  return fold;
}

Fit fit_from(const Fit& start, const TransitionModel& model, const Fit& recalibrated, FitOptions options) {
  options.most_iterations = start.converged ? fold_steps : effort_for(model, recalibrated).most_iterations;
  if (start.converged) {
    options.evaluation = &start.evaluation;
    options.derivatives = &start.derivatives;
    options.ends_as_foretold = true;
  }
  return fit(model, start.nuisance, start.terms, options);
}

Estimate ClosedShare::estimate() const {
  std::vector<double> sorted = drawn;
  std::ranges::sort(sorted);
  return {value, sorted[sorted.size() * 5 / 100], sorted[sorted.size() * 95 / 100]};
}

ClosedShare mean_of(const ClosedShare& one, const ClosedShare& other) {
  ClosedShare mean{0.5 * (one.value + other.value), {}};
  for (std::size_t draw = 0; draw < one.drawn.size(); ++draw)
    mean.drawn.push_back(0.5 * (one.drawn[draw] + other.drawn[draw]));
  return mean;
}

namespace {

// A fit, with whether its nuisances are refitted.
using Refitted = std::pair<const Fit*, bool>;

// Adds what a model says of the events of the trials counted to the sums by trial.
void add_scores(const TransitionModel& model, const Evaluation& evaluation, double weight,
                const std::function<bool(std::size_t trial)>& counts, std::vector<double>& score) {
  for (std::size_t i = 0; i < model.events().size(); ++i)
    if (const std::size_t trial = model.events()[i].trial; counts(trial))
      score[trial] += weight * evaluation.log_density[i];
}

// Returns [fits][trials] log scores without what fitting gains or costs. To first order p parameters gain p / 2 on the
// trials that they are fitted to, and lose p / 2 k / (k - 1) on those that k folds hold out.
std::vector<std::vector<double>> unbiased_scores(const TransitionModel& model, const Fit& recalibrated,
                                                 const std::vector<Refitted>& fits, int folds, int threads,
                                                 std::uint64_t seed, const std::function<void()>& beat) {
  const std::size_t trials = model.trials();
  const std::vector<int> fold = folds_of_trials(trials, folds, seed);
  const double fitted_share = folds / (2.0 * folds - 1);
  std::vector<std::vector<double>> score(fits.size(), std::vector<double>(trials));
  for (std::size_t k = 0; k < fits.size(); ++k)
    add_scores(
        model, fits[k].first->evaluation, fitted_share, [](std::size_t) { return true; }, score[k]);
  model.side_by_side(fits.size() * static_cast<std::size_t>(folds), threads, [&](std::size_t task) {
    beat();
    const std::size_t k = task / static_cast<std::size_t>(folds);
    const auto f = static_cast<int>(task % static_cast<std::size_t>(folds));
    FitOptions options;
    options.count.resize(trials);
    for (std::size_t t = 0; t < trials; ++t) options.count[t] = fold[t] != f;
    options.refit_nuisances = fits[k].second;
    const bool nothing_free = !fits[k].second && fits[k].first->terms.empty();
    const Fit fitted = nothing_free ? *fits[k].first : fit_from(*fits[k].first, model, recalibrated, options);
    add_scores(
        model, fitted.evaluation, 1 - fitted_share, [&](std::size_t t) { return fold[t] == f; }, score[k]);
  });
  return score;
}

}  // namespace

std::vector<ClosedShare> parts_closed(const TransitionModel& model, const Fit& recalibrated, const WholeGap& gap,
                                      const std::vector<GapPart>& parts, int folds, int threads, std::uint64_t seed,
                                      const std::function<void()>& heartbeat) {
  std::vector<Refitted> fits{{gap.best, true}, {gap.given, false}};  // each once
  for (const GapPart& part : parts)
    for (const Refitted& one : {Refitted{part.with, part.recalibrated}, Refitted{part.without, part.recalibrated}})
      if (std::ranges::find(fits, one) == fits.end()) fits.push_back(one);
  const std::vector<std::vector<double>> scores =
      unbiased_scores(model, recalibrated, fits, folds, threads, seed, markov::one_at_a_time(heartbeat));
  const auto score = [&](const Fit* one, bool refitted) -> const std::vector<double>& {
    return scores[static_cast<std::size_t>(std::ranges::find(fits, Refitted{one, refitted}) - fits.begin())];
  };
  const std::vector<double>&best = score(gap.best, true), &given = score(gap.given, false);
  std::vector<ClosedShare> closed;
  for (const GapPart& part : parts) {
    const std::vector<double>& with = score(part.with, part.recalibrated);
    const std::vector<double>& without = score(part.without, part.recalibrated);
    const auto share = [&](auto weight_of) {
      double closes = 0, all = 0, left = 0;
      for (std::size_t t = 0; t < model.trials(); ++t) {
        closes += weight_of(t) * (with[t] - without[t]);
        all += weight_of(t) * (best[t] - given[t]);
        left += weight_of(t) * gap.left[t];
      }
      return closes / (all + std::max(0.0, left));
    };
    ClosedShare& one = closed.emplace_back(ClosedShare{share([](std::size_t) { return 1.0; }), {}});
    for (std::uint64_t draw = 0; draw < closing_draws; ++draw)
      one.drawn.push_back(share([&](std::size_t t) { return exponential_weight(seed, draw, t); }));
  }
  return closed;
}

}  // namespace metastable::analysis
