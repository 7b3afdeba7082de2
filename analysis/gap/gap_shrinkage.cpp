#include "analysis/gap/gap_shrinkage.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "analysis/gap/gap_map.h"
#include "analysis/gap/held_out.h"
#include "analysis/statistics/bounded_interval.h"
#include "analysis/statistics/median.h"
#include "analysis/statistics/random.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/dense_matrix.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double cell_shift_sd = 0.15;           // prior of a cell's shift, in scores
constexpr double parameter_price = 1.5;          // log likelihood that a rival pays for a parameter of its effects
constexpr int interval_draws = 400;              // of the bootstrap over trials
constexpr double bounded_score = 6;              // scores further out count as this one to the flexible model
constexpr double farthest_score = 12;            // and as this one to the CRPS
constexpr double far_out = 1.5, most_units = 3;  // for units_tell(): of the scores' median; of the likeliest model's

// Holds what one trial, held out, says.
struct HeldOut {
  double collisions = 0;
  double log_score[3] = {0, 0, 0};  // as given, recalibrated, with effect
  double flexible = 0;              // gain of the flexible model over the third
  double flexible_floor = 0;        // that gain expected without a gap
  double crps[3] = {0, 0, 0};
  double crps_floor = 0;
};

double crps(double z) {
  return z * (2 * dynamics::normal_cdf(z) - 1) + 2 * dynamics::normal_density(z) - std::numbers::inv_sqrtpi;
}

// Says whether units tell how widely this model foretells values. Where most values lie in its tails, which wild rows
// make long, units are those of the tails: there they must not exceed three times those of the likeliest model, which
// has none that lie so.
bool units_tell(const TransitionModel& model, const Evaluation& e, const Evaluation& likeliest) {
  std::vector<double> scores, units, usual;
  for (std::size_t i = 0; i < e.unit.size(); ++i) {
    const EventKind kind = model.events()[i].kind;
    if (kind != EventKind::collision && kind != EventKind::step && kind != EventKind::stance) continue;
    scores.push_back(std::abs(e.score[i]));
    units.push_back(e.unit[i]);
    usual.push_back(likeliest.unit[i]);
  }
  return scores.empty() || median(std::move(scores)) < far_out ||
         (&e != &likeliest && median(std::move(units)) < most_units * median(std::move(usual)));
}

// Returns [rad/s of a score] by kind of event.
std::vector<double> typical_units(const TransitionModel& model, const Evaluation& e) {
  std::vector<double> typical(6, 0.0);
  for (std::size_t kind = 0; kind < typical.size(); ++kind) {
    std::vector<double> units;
    for (std::size_t i = 0; i < e.unit.size(); ++i)
      if (static_cast<std::size_t>(model.events()[i].kind) == kind) units.push_back(e.unit[i]);
    if (!units.empty()) typical[kind] = median(std::move(units));
  }
  return typical;
}

Shrinkage summarise(const std::vector<HeldOut>& trials, std::uint64_t seed, const std::string& measure,
                    const std::string& unit, const std::function<void(const HeldOut&, double*)>& values) {
  const auto average = [&](auto weight_of) {
    double sum[4] = {0, 0, 0, 0}, count = 0;
    for (std::size_t t = 0; t < trials.size(); ++t) {
      const double w = weight_of(t);
      double v[4];
      values(trials[t], v);
      for (int i = 0; i < 4; ++i) sum[i] += w * v[i];
      count += w * trials[t].collisions;
    }
    std::vector<double> mean(4, 0.0);
    for (int i = 0; i < 4; ++i) mean[static_cast<std::size_t>(i)] = count > 0 ? sum[i] / count : 0;
    return mean;
  };
  Shrinkage s;
  s.measure = measure;
  s.unit = unit;
  const auto here = average([](std::size_t) { return 1.0; });
  s.baseline = here[0];
  s.recalibrated = here[1];
  s.with_effect = here[2];
  s.floor = here[3];
  std::vector<double> gaps, left, baselines, with_effect;  // left: shares of the gap
  s.with_effect_least = s.with_effect;
  for (std::uint64_t draw = 0; draw < interval_draws; ++draw) {  // trials drawn anew, by exponential weights
    const auto mean = average([&](std::size_t t) { return exponential_weight(seed, draw, t); });
    baselines.push_back(mean[0]);
    gaps.push_back(mean[0] - mean[3]);
    s.with_effect_least = std::min(s.with_effect_least, mean[2]);
    with_effect.push_back(mean[2]);
    if (gaps.back() > 0) left.push_back((mean[2] - mean[3]) / gaps.back());
  }
  std::sort(baselines.begin(), baselines.end());
  std::sort(with_effect.begin(), with_effect.end());
  std::sort(gaps.begin(), gaps.end());
  std::sort(left.begin(), left.end());
  s.baseline_lower = baselines[interval_draws * 5 / 100];
  s.baseline_upper = baselines[interval_draws * 95 / 100];
  s.with_effect_lower = with_effect[interval_draws * 5 / 100];
  s.with_effect_upper = with_effect[interval_draws * 95 / 100];
  if (gaps[interval_draws * 5 / 100] > 0 && left.size() > interval_draws / 2) {
    // No model leaves less than nothing.
    const double share = (s.with_effect - s.floor) / (s.baseline - s.floor);
    const auto at = [&](double score) {
      return left[static_cast<std::size_t>(dynamics::normal_cdf(score) * static_cast<double>(left.size() - 1))];
    };
    const double error = std::max(1e-12, (at(1) - at(-1)) / 2), estimate = share / error;
    const auto [lower, upper] = bounded_interval(estimate);
    s.closed = std::min(1.0, 1 - share);
    s.closed_lower = 1 - std::max(0.0, at(upper - estimate));
    s.closed_upper = lower > 0 ? 1 - std::max(0.0, at(lower - estimate)) : 1;
  }
  return s;
}

// Returns the rival that does best on the trials counted; without any, `plain`.
Fit best_rival(const TransitionModel& model, const Fit& recalibrated, const std::vector<const Fit*>& rivals,
               const Fit& plain, const FitOptions& options, const std::function<void()>& heartbeat) {
  Fit chosen = plain;
  double best = -1e300;
  for (const Fit* rival : rivals) {
    heartbeat();
    Fit tried = fit_from(*rival, model, recalibrated, options);
    double price = 0;  // those that have a prior have paid by it
    for (const EffectTerm& term : rival->terms)
      for (const FreeParameter& parameter : term.candidate->parameters)
        if (!(parameter.prior_sd > 0)) price += parameter_price;
    const double score = tried.penalised - price;
    if (score > best) {
      best = score;
      chosen = std::move(tried);
    }
  }
  return chosen;
}

// The flexible model shifts the scores in every cell by a ridge fit to the trials counted.
struct Flexible {
  Eigen::VectorXd bounded;    // [events] scores of the chosen model, less what is known of them
  Eigen::VectorXd predicted;  // [events] their shifts
  Eigen::VectorXd variance;   // [events] of the shifts, without a gap
};

// Returns [cells x cells] what the cells' sums of scores scatter by chance: trials are independent, events of a trial
// need not be, and fitted parameters take part of it up.
// @param left  [events] what the shifts leave of the scores  @param known  [events] the part of scores that is known
Eigen::MatrixXd chance_of_sums(const TransitionModel& model, const Fit& chosen, const Eigen::MatrixXd& cells,
                               const Eigen::VectorXd& training, const Eigen::VectorXd& left,
                               const Eigen::VectorXd& known) {
  const auto trials = static_cast<Eigen::Index>(model.trials());
  const Derivatives& by = chosen.derivatives;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(trials, cells.cols());
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(trials, by.slope.cols());
  for (Eigen::Index i = 0; i < training.size(); ++i) {
    const auto trial = static_cast<Eigen::Index>(model.events()[static_cast<std::size_t>(i)].trial);
    sums.row(trial) += training[i] * left[i] * cells.row(i);
    slopes.row(trial) += training[i] * (by.slope.row(i) + known[i] * by.change.row(i));
  }
  const Eigen::MatrixXd taken = by.change.transpose() * (training.asDiagonal() * cells);
  if (slopes.cols() > 0) {
    const Eigen::MatrixXd root = resolved_root(chosen.information);
    sums += slopes * (root * (root.transpose() * taken));
  }
  return sums.transpose() * sums;
}

Flexible flexible_model(const TransitionModel& model, const Fit& chosen, const Eigen::MatrixXd& cells,
                        const Eigen::VectorXd& training) {
  Flexible f;
  const Eigen::Map<const Eigen::VectorXd> z(chosen.evaluation.score.data(), training.size());
  Eigen::VectorXd known(training.size());
  for (Eigen::Index i = 0; i < known.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    known[i] = model.events()[at].added / chosen.evaluation.unit[at];
  }
  f.bounded = (z - known).cwiseMax(-bounded_score).cwiseMin(bounded_score);
  const Eigen::MatrixXd gram = cells.transpose() * training.asDiagonal() * cells;
  Eigen::MatrixXd ridge = gram;
  ridge.diagonal().array() += 1 / (cell_shift_sd * cell_shift_sd);
  const Eigen::VectorXd shift = markov::solve_symmetric(ridge, cells.transpose() * (training.asDiagonal() * f.bounded));
  f.predicted = cells * shift;
  // Without a gap the shifts are noise: their expected loss on a new event is half its predicted variance.
  const Eigen::MatrixXd noise = chance_of_sums(model, chosen, cells, training, f.bounded - f.predicted, known);
  const Eigen::MatrixXd inverse = markov::solve_columns(ridge, Eigen::MatrixXd::Identity(ridge.rows(), ridge.cols()));
  f.variance = (cells * (inverse * noise * inverse)).cwiseProduct(cells).rowwise().sum();
  return f;
}

// The log score, and the CRPS where one column is observed: columns of several units have no mean distance.
std::vector<Shrinkage> held_out_measures(const TransitionModel& model, const std::vector<HeldOut>& held,
                                         std::uint64_t seed) {
  std::vector<Shrinkage> all;
  const std::vector<ObservedColumn> columns = model.columns();
  all.push_back(
      summarise(held, seed, "held-out log score per " + model.step_name(), "nats", [](const HeldOut& h, double* v) {
        const double best = h.log_score[2] + h.flexible;
        for (int m = 0; m < 3; ++m) v[m] = best - h.log_score[m] - h.flexible_floor;
        v[3] = 0;
      }));
  if (columns.size() > 1) return all;
  all.push_back(summarise(held, seed, "held-out CRPS of the next " + columns[0].name, columns[0].unit,
                          [](const HeldOut& h, double* v) {
                            for (int m = 0; m < 3; ++m) v[m] = h.crps[m];
                            v[3] = h.crps_floor;
                          }));
  return all;
}

}  // namespace

HeldOutGap gap_shrinkage(const TransitionModel& model, const Fit& given, const Fit& recalibrated,
                         const std::vector<const Fit*>& rivals, int folds, int threads, std::uint64_t seed,
                         const std::function<void()>& heartbeat) {
  if (folds < 2) throw std::invalid_argument(fmt::format("folds: {} is below 2", folds));
  const std::size_t trials = model.trials();
  const Eigen::MatrixXd cells = mean_columns(model);
  const std::vector<int> fold = folds_of_trials(trials, folds, seed);
  std::vector<HeldOut> held(trials);
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  model.side_by_side(static_cast<std::size_t>(folds), threads, [&](std::size_t f) {
    beat();
    FitOptions options;
    options.count.resize(trials);
    for (std::size_t t = 0; t < trials; ++t) options.count[t] = fold[t] != static_cast<int>(f);
    const Fit plain = fit_from(recalibrated, model, recalibrated, options);
    const Fit chosen = best_rival(model, recalibrated, rivals, plain, options, beat);
    const Eigen::VectorXd training = event_weights(model, options.count);
    const Flexible flexible = flexible_model(model, chosen, cells, training);
    const std::array<const Evaluation*, 3> models{&given.evaluation, &plain.evaluation, &chosen.evaluation};
    std::array<std::vector<double>, 3> units;
    for (std::size_t m = 0; m < 3; ++m) units[m] = typical_units(model, *models[m]);
    for (std::size_t i = 0; i < model.events().size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      if (training[at] != 0) continue;
      const Event& event = model.events()[i];
      HeldOut& out = held[event.trial];
      const bool speed = event.kind == EventKind::collision || event.kind == EventKind::step;
      out.collisions += begins_step(model.events(), i);
      for (std::size_t m = 0; m < 3; ++m) out.log_score[m] += models[m]->log_density[i];
      const double shift = flexible.predicted[at];
      out.flexible += flexible.bounded[at] * shift - 0.5 * shift * shift;
      out.flexible_floor -= 0.5 * flexible.variance[at];
      if (!speed && event.kind != EventKind::stance) continue;
      const auto kind = static_cast<std::size_t>(event.kind);
      for (std::size_t m = 0; m < 3; ++m)
        out.crps[m] += units[m][kind] * crps(std::clamp(models[m]->score[i], -farthest_score, farthest_score));
      out.crps_floor += units[2][kind] * std::numbers::inv_sqrtpi;
    }
  });

  HeldOutGap result;
  for (const HeldOut& h : held) result.left.push_back(h.flexible - h.flexible_floor);
  result.measures = held_out_measures(model, held, seed);
  const Evaluation& likeliest = (rivals.empty() ? recalibrated : *rivals.front()).evaluation;
  for (const Evaluation* one : {&likeliest, &recalibrated.evaluation, &given.evaluation})
    if (!units_tell(model, *one, likeliest)) result.measures.resize(1);
  return result;
}

double gap_by_itself(const TransitionModel& model, const Fit& chosen, int folds, int threads, std::uint64_t seed,
                     const std::function<void()>& heartbeat) {
  constexpr std::uint64_t draws = 2;
  double sum = 0;
  for (std::uint64_t draw = 1; draw <= draws; ++draw) {
    if (heartbeat) heartbeat();
    const auto drawn = model.simulate(chosen.nuisance, chosen.terms, seed + draw);
    const Fit fitted = fit(*drawn, chosen.nuisance, chosen.terms);
    sum += gap_shrinkage(*drawn, fitted, fitted, {}, folds, threads, seed, heartbeat).measures.front().with_effect;
  }
  return sum / static_cast<double>(draws);
}

Shrinkage rest_shrinkage(double at_risk, double rests, const StepsBeforeFailure& steps, const std::string& measure) {
  const double observed = rests / at_risk;
  const double low = 1 / steps.observed_upper, high = 1 / steps.observed_lower;
  const double given = 1 / steps.baseline, with = 1 / steps.with_effect;
  Shrinkage s;
  s.measure = measure;
  s.unit = "probability";
  s.baseline = std::abs(given - observed);
  s.recalibrated = std::abs(1 / steps.recalibrated - observed);
  s.with_effect = std::abs(with - observed);
  const bool inside = given > low && given < high;
  s.baseline_lower = inside ? 0 : std::min(std::abs(given - low), std::abs(given - high));
  s.baseline_upper = std::max(std::abs(given - low), std::abs(given - high));
  // This is the mean absolute deviation of a Poisson count.
  const double mean = with * at_risk, whole = std::floor(mean);
  s.floor = mean > 0 ? 2 * std::exp((whole + 1) * std::log(mean) - mean - std::lgamma(whole + 1)) / at_risk : 0;
  if (s.baseline_lower <= s.floor) return s;
  const auto closed = [&](double share) {
    const double gap = std::abs(given - share);
    return std::min(1.0, (gap - std::abs(with - share)) / (gap - s.floor));
  };
  const double at_peak = closed(std::clamp(with, low, high));
  s.closed = closed(observed);
  s.closed_lower = std::min(closed(low), closed(high));
  s.closed_upper = std::max({closed(low), closed(high), at_peak});
  return s;
}

}  // namespace metastable::analysis
