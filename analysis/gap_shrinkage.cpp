#include "analysis/gap_shrinkage.h"

#include <Random123/philox.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "analysis/gap_map.h"
#include "dynamics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double cell_shift_sd = 0.15;  // prior of a cell's shift, in scores

// What one trial, held out, says.
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

std::vector<double> typical_units(const TransitionModel& model, const Evaluation& e) {
  std::vector<double> typical(6, 0.0);
  for (std::size_t kind = 0; kind < typical.size(); ++kind) {
    std::vector<double> units;
    for (std::size_t i = 0; i < e.unit.size(); ++i)
      if (static_cast<std::size_t>(model.events()[i].kind) == kind) units.push_back(e.unit[i]);
    if (units.empty()) continue;
    std::nth_element(units.begin(), units.begin() + static_cast<std::ptrdiff_t>(units.size() / 2), units.end());
    typical[kind] = units[units.size() / 2];
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
  constexpr int draws = 400;
  std::vector<double> gaps, closed;
  std::vector<double> baselines;
  for (int draw = 0; draw < draws; ++draw) {  // trials drawn anew, by exponential weights
    const auto mean = average([&](std::size_t t) {
      const r123::Philox4x64::ctr_type counter{{static_cast<std::uint64_t>(draw), t, 3, 0}};
      const auto bits = r123::Philox4x64()(counter, {{seed, 0x73687269}});
      return -std::log((static_cast<double>(bits[0] >> 12) + 0.5) * 0x1p-52);
    });
    baselines.push_back(mean[0]);
    gaps.push_back(mean[0] - mean[3]);
    if (gaps.back() > 0) closed.push_back((mean[0] - mean[2]) / gaps.back());
  }
  std::sort(baselines.begin(), baselines.end());
  std::sort(gaps.begin(), gaps.end());
  std::sort(closed.begin(), closed.end());
  s.baseline_lower = baselines[draws * 5 / 100];
  s.baseline_upper = baselines[draws * 95 / 100];
  if (gaps[draws * 5 / 100] > 0 && closed.size() > draws / 2) {
    s.closed = (s.baseline - s.with_effect) / (s.baseline - s.floor);
    s.closed_lower = closed[closed.size() * 5 / 100];
    s.closed_upper = closed[closed.size() * 95 / 100];
  }
  return s;
}

}  // namespace

std::vector<Shrinkage> gap_shrinkage(const TransitionModel& model, const Fit& recalibrated,
                                     const std::vector<const Fit*>& rivals, int folds, int threads,
                                     std::uint64_t seed) {
  const std::size_t trials = model.trials();
  const std::vector<double> nominal = nominal_values(model);
  const Evaluation as_given = model.evaluate(nominal, {});
  const Eigen::MatrixXd cells = mean_columns(model);
  std::vector<HeldOut> held(trials);

  // Trials go to folds in turn, in an order of their own.
  std::vector<std::size_t> order(trials);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [seed](std::size_t t) { return r123::Philox4x64()({{t, 4, 0, 0}}, {{seed, 0x666f6c64}})[0]; };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
  std::vector<int> fold(trials);
  for (std::size_t k = 0; k < trials; ++k) fold[order[k]] = static_cast<int>(k % static_cast<std::size_t>(folds));

  markov::parallel_for(static_cast<std::size_t>(folds), threads, [&](std::size_t f) {
    FitOptions options;
    options.count.resize(trials);
    for (std::size_t t = 0; t < trials; ++t) options.count[t] = fold[t] != static_cast<int>(f);
    const Fit plain = fit(model, recalibrated.nuisance, {}, options);
    Fit chosen = plain;
    double best = -1e300;
    for (const Fit* rival : rivals) {
      Fit tried = fit(model, rival->nuisance, rival->terms, options);
      std::size_t parameters = 0;
      for (const Term& term : rival->terms) parameters += term.values.size();
      const double score = tried.penalised - 1.5 * static_cast<double>(parameters);
      if (score > best) {
        best = score;
        chosen = std::move(tried);
      }
    }
    // The flexible model: shifts of the scores in every cell, ridge-fitted to the other trials.
    const Eigen::VectorXd training = event_weights(model, options.count);
    const Eigen::VectorXd testing = Eigen::VectorXd::Ones(training.size()) - training;
    const Eigen::Map<const Eigen::VectorXd> z(chosen.evaluation.score.data(), training.size());
    const Eigen::VectorXd bounded = z.cwiseMax(-6.0).cwiseMin(6.0);
    const Eigen::MatrixXd gram = cells.transpose() * training.asDiagonal() * cells;
    Eigen::MatrixXd ridge = gram;
    ridge.diagonal().array() += 1 / (cell_shift_sd * cell_shift_sd);
    const auto solver = ridge.ldlt();
    const Eigen::VectorXd shift = solver.solve(cells.transpose() * (training.asDiagonal() * bounded));
    const Eigen::VectorXd predicted = cells * shift;
    // Without a gap the shifts are noise, less what the fitted parameters took up: their expected loss on a new event
    // is half its predicted variance.
    const Eigen::MatrixXd taken = chosen.derivatives.change.transpose() * (training.asDiagonal() * cells);
    const Eigen::MatrixXd left = gram - taken.transpose() * chosen.information.ldlt().solve(taken);
    const Eigen::MatrixXd noise = solver.solve(solver.solve(left).transpose());
    const Eigen::VectorXd variance = (cells * noise).cwiseProduct(cells).rowwise().sum();

    const Evaluation* models[3] = {&as_given, &plain.evaluation, &chosen.evaluation};
    std::vector<double> units[3];
    for (int m = 0; m < 3; ++m) units[m] = typical_units(model, *models[m]);
    for (std::size_t i = 0; i < model.events().size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      if (testing[at] == 0) continue;
      const Event& event = model.events()[i];
      HeldOut& out = held[event.trial];
      const bool speed = event.kind == EventKind::collision || event.kind == EventKind::step;
      out.collisions += speed;
      for (int m = 0; m < 3; ++m) out.log_score[m] += models[m]->log_density[i];
      out.flexible += bounded[at] * predicted[at] - 0.5 * predicted[at] * predicted[at];
      out.flexible_floor -= 0.5 * variance[at];
      if (speed || event.kind == EventKind::stance) {
        const auto kind = static_cast<std::size_t>(event.kind);
        for (int m = 0; m < 3; ++m) out.crps[m] += units[m][kind] * crps(std::clamp(models[m]->score[i], -12.0, 12.0));
        out.crps_floor += units[2][kind] * std::numbers::inv_sqrtpi;
      }
    }
  });

  std::vector<Shrinkage> all;
  all.push_back(summarise(held, seed, "held-out log score per collision", "nats", [](const HeldOut& h, double* v) {
    const double best = h.log_score[2] + h.flexible;
    for (int m = 0; m < 3; ++m) v[m] = best - h.log_score[m] - h.flexible_floor;
    v[3] = 0;
  }));
  all.push_back(summarise(held, seed, "held-out CRPS of the next speed", "rad/s", [](const HeldOut& h, double* v) {
    for (int m = 0; m < 3; ++m) v[m] = h.crps[m];
    v[3] = h.crps_floor;
  }));
  return all;
}

}  // namespace metastable::analysis
