#include "analysis/gap_map.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>

#include "dynamics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double tail_score = 2.2;
constexpr double least_rests = 3;  // seen or expected, for a statement on them
constexpr std::size_t enough_trials = 40;
constexpr double beyond_doubt = 5;        // [standard deviations]
constexpr double largest_frequency = 60;  // [Hz] of a swing with the time since the previous collision
constexpr double most_frequencies = 30;

// Members of one cell: the events that it holds. With weights it is a contrast of means: a trend, a swing.
struct Cell {
  std::string facet = {}, at = {};
  std::vector<std::size_t> events = {};
  bool stance = false;
  std::vector<double> weights = {};  // by event; empty: 1
  bool swing = false;
};

bool is_stance(EventKind kind) { return kind == EventKind::stance; }
bool is_contact(EventKind kind) { return kind != EventKind::stance && kind != EventKind::launch; }

// What an event adds to the sums of a cell: functions of its normal score, or their means given that the wheel rested
// (a score below that of the chance of rest) or did not. All have mean zero if the model is right.
struct Residual {
  double mean = 0, spread = 0, tail = 0;
};

Residual residual(EventKind kind, double score, double log_density) {
  const double share_beyond = 2 * dynamics::normal_cdf(-tail_score);
  if (kind != EventKind::rest && kind != EventKind::survival) {
    const double s = std::clamp(score, -6.0, 6.0);
    return {s, (s * s - 1) / std::numbers::sqrt2, (std::abs(s) > tail_score ? 1 : 0) - share_beyond};
  }
  const bool rested = kind == EventKind::rest;
  const double chance = std::clamp(rested ? std::exp(log_density) : -std::expm1(log_density), 1e-12, 1 - 1e-12);
  const double edge = dynamics::normal_quantile(chance), density = dynamics::normal_density(edge);
  const double beyond = dynamics::normal_cdf(std::min(edge, -tail_score)) +
                        std::max(0.0, dynamics::normal_cdf(edge) - dynamics::normal_cdf(tail_score));
  const double weight = rested ? 1 / chance : -1 / (1 - chance);
  return {-density * weight, -edge * density * weight / std::numbers::sqrt2, (beyond - share_beyond * chance) * weight};
}

// Cuts into `parts` of equal counts.
std::vector<double> quantile_cuts(std::vector<double> values, int parts) {
  std::sort(values.begin(), values.end());
  std::vector<double> cuts;
  for (int i = 1; i < parts; ++i)
    cuts.push_back(values[values.size() * static_cast<std::size_t>(i) / static_cast<std::size_t>(parts)]);
  cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
  return cuts;
}

class Cutter {
 public:
  explicit Cutter(const TransitionModel& model) : model_(model) {}

  std::vector<Cell> cells() {
    const auto& events = model_.events();
    const bool two_phases = std::any_of(events.begin(), events.end(), [](const Event& e) { return is_stance(e.kind); });
    for (const bool stance : {false, true}) {
      if (stance && !two_phases) continue;
      std::vector<std::size_t> members;
      for (std::size_t i = 0; i < events.size(); ++i)
        if (stance ? is_stance(events[i].kind) : is_contact(events[i].kind)) members.push_back(i);
      if (members.size() < least_cell_events) continue;
      const std::size_t first = cells_.size();
      const std::string where = !two_phases ? "" : stance ? ", stance" : ", collision";
      ranges("speed", members, where, 5, "rad/s", [](const Event& e) { return std::optional(e.speed); });
      groups("leg", members, where, [](const Event& e) {
        return e.leg ? std::optional(std::pair{*e.leg, fmt::format("leg {}", *e.leg)}) : std::nullopt;
      });
      ranges("position", members, where, 6, "m", [](const Event& e) { return std::optional(e.position); });
      groups("collision", members, where, [](const Event& e) {
        static constexpr int ends[] = {1, 2, 4, 8, 12, 16};
        int from = 1;
        for (int i = 0; i < 6; ++i) {
          if (e.number <= ends[i])
            return std::optional(std::pair{i, from == ends[i] ? fmt::format("collision {}", from)
                                                              : fmt::format("collisions {} to {}", from, ends[i])});
          from = ends[i] + 1;
        }
        return std::optional(std::pair{6, std::string("collisions from 17")});
      });
      ranges("trial", members, where, 6, "",
             [](const Event& e) { return std::optional(static_cast<double>(e.trial + 1)); });
      if (model_.trials() > 2) trend(members, where);
      ranges("time", members, where, 5, "s since the previous collision",
             [](const Event& e) { return e.since_previous; });
      if (!stance && model_.legs() > 0) swings(members, where);  // a drum's time is its speed
      if (model_.conditions() > 1)
        groups("condition", members, where, [this](const Event& e) {
          return std::optional(std::pair{static_cast<int>(e.condition), model_.condition_name(e.condition)});
        });
      cells_.push_back({"phase", !two_phases ? "step" : stance ? "stance" : "collision", members, stance});
      for (std::size_t c = first; c < cells_.size(); ++c) cells_[c].stance = stance;
    }
    std::vector<std::size_t> launches;
    for (std::size_t i = 0; i < events.size(); ++i)
      if (events[i].kind == EventKind::launch) launches.push_back(i);
    if (launches.size() >= 10) cells_.push_back({"collision", "launch", launches, false});
    return std::move(cells_);
  }

 private:
  template <class Key>
  void groups(const char* facet, const std::vector<std::size_t>& members, const std::string& where, Key key) {
    std::map<int, Cell> found;
    for (const std::size_t i : members)
      if (const auto k = key(model_.events()[i])) {
        Cell& cell = found[k->first];
        cell.facet = facet;
        cell.at = k->second + where;
        cell.events.push_back(i);
      }
    if (found.size() < 2) return;
    for (auto& [index, cell] : found)
      if (cell.events.size() >= least_cell_events) cells_.push_back(std::move(cell));
  }
  template <class Value>
  void ranges(const char* facet, const std::vector<std::size_t>& members, const std::string& where, int parts,
              const char* unit, Value value) {
    std::vector<double> all;
    for (const std::size_t i : members)
      if (const auto v = value(model_.events()[i])) all.push_back(*v);
    if (all.size() < 2 * least_cell_events) return;
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    const double low = *least, high = *most;
    if (!(low < high)) return;
    const std::vector<double> cuts = quantile_cuts(all, parts);
    groups(facet, members, where, [&](const Event& e) -> std::optional<std::pair<int, std::string>> {
      const auto v = value(e);
      if (!v) return std::nullopt;
      const auto at = std::upper_bound(cuts.begin(), cuts.end(), *v) - cuts.begin();
      const double from = at == 0 ? low : cuts[static_cast<std::size_t>(at) - 1];
      const double to = static_cast<std::size_t>(at) == cuts.size() ? high : cuts[static_cast<std::size_t>(at)];
      return std::pair{static_cast<int>(at),
                       fmt::format("{} {:.3g} to {:.3g}{}{}", facet, from, to, *unit ? " " : "", unit)};
    });
  }

  // From -1 at the first trial to 1 at the last one.
  void trend(const std::vector<std::size_t>& members, const std::string& where) {
    Cell cell{"trial", "trend over the trials" + where, members, false};
    const double last = static_cast<double>(model_.trials() - 1);
    for (const std::size_t i : members)
      cell.weights.push_back(2 * static_cast<double>(model_.events()[i].trial) / last - 1);
    cells_.push_back(std::move(cell));
  }
  // Cosine and sine of the time since the previous collision: as many frequencies as its spread tells apart.
  void swings(const std::vector<std::size_t>& members, const std::string& where) {
    std::vector<double> times;
    Cell cell{.facet = "time", .swing = true};
    for (const std::size_t i : members)
      if (const auto t = model_.events()[i].since_previous) {
        cell.events.push_back(i);
        times.push_back(*t);
      }
    if (times.size() < 2 * least_cell_events) return;
    std::vector<double> sorted = times;
    std::sort(sorted.begin(), sorted.end());
    const double middle = sorted[sorted.size() / 2],
                 spread = sorted[sorted.size() * 19 / 20] - sorted[sorted.size() / 20];
    if (!(spread > 0)) return;
    const double spacing = std::max(0.5 / spread, largest_frequency / most_frequencies);
    for (double f = 1 / spread; f <= largest_frequency; f += spacing)
      for (const double phase : {0.0, 0.5 * std::numbers::pi}) {
        cell.at = fmt::format("{} of {:.3g} Hz in the time since the previous collision{}",
                              phase == 0 ? "cosine" : "sine", f, where);
        cell.weights.clear();
        for (const double t : times) cell.weights.push_back(std::cos(2 * std::numbers::pi * f * (t - middle) - phase));
        cells_.push_back(cell);
      }
  }

  const TransitionModel& model_;
  std::vector<Cell> cells_;
};

}  // namespace

Eigen::MatrixXd mean_columns(const TransitionModel& model) {
  std::vector<Cell> cells = Cutter(model).cells();
  std::erase_if(cells, [](const Cell& cell) { return !cell.weights.empty(); });
  Eigen::MatrixXd columns =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.events().size()), static_cast<Eigen::Index>(cells.size()));
  for (std::size_t c = 0; c < cells.size(); ++c)
    for (const std::size_t i : cells[c].events) columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) = 1;
  return columns;
}

double GapMap::largest_beyond(double collisions, double stances) const {
  double most = 0;
  for (const GapCell& cell : cells)
    most = std::max(most, cell.statistic * cell.statistic - (cell.stance ? stances : collisions));
  return most;
}

GapMap gap_map(const TransitionModel& model, const Fit& fit, int draws, std::uint64_t seed) {
  const auto& events = model.events();
  const std::vector<double>& z = fit.evaluation.score;
  const auto count = static_cast<Eigen::Index>(events.size());
  std::vector<Cell> cells = Cutter(model).cells();

  // Each column of `raw` sums to the statistic of one cell and aspect; its mean is zero without a gap.
  GapMap map;
  std::vector<std::vector<std::pair<std::size_t, double>>> raw;
  std::vector<double> without_gap;            // variance of each sum under the model
  std::vector<std::vector<double>> contrast;  // of a cell that is a contrast; empty: 1
  const auto add = [&](const Cell& cell, const char* aspect, std::string unit, double size,
                       std::vector<std::pair<std::size_t, double>> column, double variance) {
    GapCell out;
    out.facet = cell.facet;
    out.aspect = aspect;
    out.at = cell.at;
    out.unit = std::move(unit);
    out.size = size;
    out.events = cell.events.size();
    out.stance = cell.stance;
    out.swing = cell.swing;
    map.cells.push_back(std::move(out));
    raw.push_back(std::move(column));
    without_gap.push_back(variance);
    contrast.push_back(cell.weights);
  };
  const double share_beyond = 2 * dynamics::normal_cdf(-tail_score);
  std::vector<Residual> residuals;
  for (std::size_t i = 0; i < events.size(); ++i)
    residuals.push_back(residual(events[i].kind, z[i], fit.evaluation.log_density[i]));
  // What a unit of score is [rad/s] in the middle of a phase's distribution: where a cell's events are far out it is
  // more there, and would exaggerate the shift that brought them out.
  std::map<EventKind, std::pair<double, double>> units;  // their sum and number; contacts as collisions
  const auto phase = [](EventKind kind) { return is_contact(kind) ? EventKind::collision : kind; };
  for (std::size_t i = 0; i < events.size(); ++i)
    if (std::abs(z[i]) < 1.5) {
      auto& [sum, number] = units[phase(events[i].kind)];
      sum += fit.evaluation.unit[i];
      ++number;
    }
  for (const Cell& cell : cells) {
    auto n = static_cast<double>(cell.events.size());
    const auto& [unit, central] = units[phase(events[cell.events.front()].kind)];
    const double in_speed = central > 0 ? unit / central : 1;  // [rad/s] of a score of one
    if (!cell.weights.empty()) {
      std::vector<std::pair<std::size_t, double>> weighted;
      n = 0;
      for (std::size_t k = 0; k < cell.events.size(); ++k) {
        weighted.emplace_back(cell.events[k], cell.weights[k] * residuals[cell.events[k]].mean);
        n += cell.weights[k] * cell.weights[k];
      }
      add(cell, "mean", "rad/s", in_speed, std::move(weighted), n);
      continue;
    }
    std::vector<std::pair<std::size_t, double>> mean, spread, tail;
    double beyond = 0;
    for (const std::size_t i : cell.events) {
      mean.emplace_back(i, residuals[i].mean);
      spread.emplace_back(i, residuals[i].spread);
      tail.emplace_back(i, residuals[i].tail);
      beyond += residuals[i].tail;
    }
    add(cell, "mean", "rad/s", in_speed, std::move(mean), n);  // the size follows below
    add(cell, "spread", "of the model's", 0, std::move(spread), n);
    if (cell.facet == "phase")
      add(cell, "tail", "share", beyond / n, std::move(tail), n * share_beyond * (1 - share_beyond));
  }
  // Memory: successive scores of a trial, of each phase; and trials that differ as a whole. By correlation, so that a
  // model far off does not pass for either.
  for (const bool stance : {false, true}) {
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < events.size(); ++i)
      if (stance ? is_stance(events[i].kind) : is_contact(events[i].kind)) members.push_back(i);
    double middle = 0, square = 0;
    for (const std::size_t i : members) {
      middle += residuals[i].mean / static_cast<double>(members.size());
      square += residuals[i].mean * residuals[i].mean / static_cast<double>(members.size());
    }
    const double sd = std::sqrt(std::max(1.0, square - middle * middle));
    std::vector<std::pair<std::size_t, double>> memory, whole;
    Cell cell{"collision", stance ? "successive stances" : "successive collisions", {}, stance};
    Cell trials{"trial", stance ? "trials as a whole, stance" : "trials as a whole", {}, stance};
    double sum = 0, between = 0, pairs = 0, in_trial = 0, partial = 0, before = 0;
    std::optional<std::size_t> previous;
    for (const std::size_t i : members) {
      const double s = (residuals[i].mean - middle) / sd;
      if (previous && events[*previous].trial == events[i].trial) {
        memory.emplace_back(i, s * before);
        sum += s * before;
        cell.events.push_back(i);
        whole.emplace_back(i, s * partial);  // adds up to half of (sum^2 - sum of squares)
        between += s * partial;
        trials.events.push_back(i);
        pairs += in_trial;
      } else {
        partial = in_trial = 0;
      }
      partial += s;
      ++in_trial;
      before = s;
      previous = i;
    }
    if (memory.size() < 20) continue;
    const double n = static_cast<double>(memory.size());
    add(cell, "memory", "correlation", sum / n, std::move(memory), n);
    add(trials, "spread", "correlation", between / pairs, std::move(whole), pairs);
  }
  // Rests against what the model expects at the same speeds.
  const std::vector<double> chance_of_rest = model.rest_chances(fit.nuisance, fit.terms);
  std::map<std::size_t, Cell> outcomes;
  for (std::size_t i = 0; i < events.size(); ++i)
    if (events[i].rested) {
      Cell& cell = outcomes[events[i].condition];
      cell.facet = "outcome";
      cell.at = "rests in " + model.condition_name(events[i].condition);
      cell.events.push_back(i);
    }
  for (auto& [condition, cell] : outcomes) {
    std::vector<std::pair<std::size_t, double>> column;
    double excess = 0, expected = 0, rests = 0, variance = 0;
    for (const std::size_t i : cell.events) {
      column.emplace_back(i, (*events[i].rested ? 1 : 0) - chance_of_rest[i]);
      excess += column.back().second;
      expected += chance_of_rest[i];
      rests += *events[i].rested;
      variance += chance_of_rest[i] * (1 - chance_of_rest[i]);
    }
    if (std::max(expected, rests) < least_rests) continue;
    add(cell, "mean", "share of collisions", excess / static_cast<double>(cell.events.size()), std::move(column),
        variance);
  }

  // Efficient: what the fitted parameters' scores explain is taken off, event by event. Nuisances move no further than
  // their prior lets them.
  const auto columns = static_cast<Eigen::Index>(raw.size());
  if (columns == 0) return map;  // too few transitions for a single cell
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(count, columns);
  for (Eigen::Index c = 0; c < columns; ++c)
    for (const auto& [i, value] : raw[static_cast<std::size_t>(c)]) dense(static_cast<Eigen::Index>(i), c) = value;
  const Eigen::RowVectorXd whole_norm = dense.colwise().squaredNorm();
  Eigen::RowVectorXd sums = dense.colwise().sum();
  if (fit.derivatives.slope.cols() > 0) {
    const Eigen::MatrixXd& held = fit.derivatives.slope;
    Eigen::MatrixXd gram = held.transpose() * held;
    Eigen::VectorXd left = held.colwise().sum();  // of the gradient at the fit: next to nothing, with the prior's pull
    for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
      const Nuisance& n = model.nuisances()[p];
      const auto at = static_cast<Eigen::Index>(p);
      gram(at, at) += 1 / (n.prior_sd * n.prior_sd);
      left[at] -= (fit.nuisance[p] - n.nominal) / (n.prior_sd * n.prior_sd);
      if (fit.nuisance[p] <= n.lower || fit.nuisance[p] >= n.upper) left[at] = 0;
    }
    gram.diagonal() *= 1 + 1e-9;
    gram.diagonal().array() += 1e-12;
    const Eigen::MatrixXd weights = gram.ldlt().solve(held.transpose() * dense);
    dense -= held * weights;
    sums -= left.transpose() * weights;
  }
  // Trials are drawn anew as wholes; where they are few, transitions are.
  const bool whole_trials = model.trials() >= enough_trials;
  Eigen::MatrixXd by_unit =
      Eigen::MatrixXd::Zero(whole_trials ? static_cast<Eigen::Index>(model.trials()) : count, columns);
  for (Eigen::Index i = 0; i < count; ++i)
    by_unit.row(whole_trials ? static_cast<Eigen::Index>(events[static_cast<std::size_t>(i)].trial) : i) +=
        dense.row(i);
  // Few trials that scatter more than their transitions would by themselves widen the scale all the same.
  Eigen::RowVectorXd scatter = Eigen::RowVectorXd::Zero(columns);
  if (const double trials = static_cast<double>(model.trials()); !whole_trials && trials > 1) {
    Eigen::MatrixXd by_trial = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.trials()), columns);
    for (Eigen::Index i = 0; i < count; ++i)
      by_trial.row(static_cast<Eigen::Index>(events[static_cast<std::size_t>(i)].trial)) += dense.row(i);
    const Eigen::RowVectorXd middle = by_trial.colwise().mean();
    scatter = (by_trial.rowwise() - middle).colwise().squaredNorm() * (trials / (trials - 1));
  }
  Eigen::RowVectorXd scale(columns);
  for (Eigen::Index c = 0; c < columns; ++c) {
    // Event-wise variance: independent without a gap, and many more of them than trials.
    const double sum = sums[c];
    // The model's own variance, less the share that the fitted parameters take off: where nothing rare happened (no
    // rest, no far score) the events themselves show almost none.
    // Where nearly all of the column is explained there is nothing left to say: a tenth is kept as the least share.
    const double kept = whole_norm[c] > 0 ? dense.col(c).squaredNorm() / whole_norm[c] : 1;
    GapCell& cell = map.cells[static_cast<std::size_t>(c)];
    const double own = std::max(kept * without_gap[static_cast<std::size_t>(c)], 1e-24);
    scale[c] = std::sqrt(
        std::max({own, dense.col(c).squaredNorm(), by_unit.col(c).squaredNorm(), scatter[c], 0.1 * whole_norm[c]}));
    cell.statistic = std::isfinite(sum) ? sum / scale[c] : 0;  // a fit far off may have no slopes to project on
    // Products of scores spread by what they look for: whether there is anything, the model's own variance tells.
    if (cell.unit == "correlation" && std::isfinite(sum)) {
      const double plain = std::clamp(sum / std::sqrt(own), -beyond_doubt, beyond_doubt);
      if (std::abs(plain) > std::abs(cell.statistic)) cell.statistic = plain;
    }
    // Efficient size: the score by its information, so that size and statistic have one sign.
    double left_over = kept;
    if (cell.aspect == "mean" && cell.facet != "outcome" && fit.derivatives.change.cols() > 0) {
      // How much of a shift of the cell the fitted parameters take up, by the slopes of its scores: where the gap is
      // large the events' own products say too much.
      Eigen::VectorXd follows = Eigen::VectorXd::Zero(fit.derivatives.change.cols());
      const std::vector<double>& weight = contrast[static_cast<std::size_t>(c)];
      for (std::size_t k = 0; k < raw[static_cast<std::size_t>(c)].size(); ++k) {
        const auto i = static_cast<Eigen::Index>(raw[static_cast<std::size_t>(c)][k].first);
        follows += (weight.empty() ? 1 : weight[k]) * fit.derivatives.change.row(i).transpose();
      }
      left_over = 1 - follows.dot(fit.information.ldlt().solve(follows)) / without_gap[static_cast<std::size_t>(c)];
    }
    const double information = std::max(1e-12, std::max(0.1, left_over) * without_gap[static_cast<std::size_t>(c)]);
    if (cell.aspect == "mean" && cell.facet != "outcome")
      cell.size = sum / information * cell.size;
    else if (cell.aspect == "spread" && cell.unit == "of the model's")
      cell.size = sum / information / std::numbers::sqrt2;
    cell.p_value = std::min(1.0, 2 * dynamics::normal_cdf(-std::abs(cell.statistic)));
  }
  const Eigen::RowVectorXd mean = by_unit.colwise().mean();
  Eigen::MatrixXd centred = by_unit.rowwise() - mean;
  for (Eigen::Index c = 0; c < columns; ++c) {
    const double norm = centred.col(c).norm();
    if (norm > 0 && std::isfinite(norm))
      centred.col(c) /= norm;
    else
      centred.col(c).setZero();
  }

  // Step-down max-T (Westfall and Young): the largest statistic against the largest by chance, the next against the
  // largest of those left, and so on.
  std::vector<std::size_t> order(map.cells.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(map.cells[a].statistic) > std::abs(map.cells[b].statistic);
  });
  std::vector<int> exceeded(order.size());
  std::vector<double> largest_by_chance;
  Eigen::VectorXd multiplier(by_unit.rows());
  for (int draw = 0; draw < draws; ++draw) {
    for (Eigen::Index t = 0; t < multiplier.size(); t += 4) {
      const r123::Philox4x64::ctr_type counter{{static_cast<std::uint64_t>(draw), static_cast<std::uint64_t>(t), 2, 0}};
      const auto bits = r123::Philox4x64()(counter, {{seed, 0x6d756c74}});
      for (Eigen::Index i = 0; i < 4 && t + i < multiplier.size(); ++i)
        multiplier[t + i] =
            dynamics::normal_quantile((static_cast<double>(bits[static_cast<std::size_t>(i)] >> 12) + 0.5) * 0x1p-52);
    }
    const Eigen::VectorXd chance = centred.transpose() * multiplier;
    double largest = 0;
    for (std::size_t k = order.size(); k-- > 0;) {
      largest = std::max(largest, std::abs(chance[static_cast<Eigen::Index>(order[k])]));
      exceeded[k] += largest >= std::abs(map.cells[order[k]].statistic);
    }
    largest_by_chance.push_back(largest);
  }
  std::sort(largest_by_chance.begin(), largest_by_chance.end());
  const double critical = largest_by_chance.empty() ? 3.5 : largest_by_chance[largest_by_chance.size() * 95 / 100];
  double adjusted = 0, discovery = 1;
  for (std::size_t k = 0; k < order.size(); ++k) {
    GapCell& cell = map.cells[order[k]];
    double p = (exceeded[k] + 1.0) / (draws + 1.0);
    // Where no draw reached it: Sidak's bound from the cell's own p-value, if that is smaller.
    if (exceeded[k] == 0) p = std::min(p, static_cast<double>(order.size() - k) * cell.p_value);
    adjusted = std::max(adjusted, std::min(1.0, p));
    cell.p_adjusted = adjusted;
    const double spread = std::abs(cell.statistic) > 1e-9 ? std::abs(cell.size / cell.statistic) : 0;
    cell.band = critical * spread;
  }
  for (std::size_t k = order.size(); k-- > 0;) {
    GapCell& cell = map.cells[order[k]];
    discovery = std::min(discovery, cell.p_value * static_cast<double>(order.size()) / static_cast<double>(k + 1));
    cell.false_discovery = discovery;
  }
  for (const GapCell& cell : map.cells) {
    map.p_value = std::min(map.p_value, cell.p_adjusted);
    map.largest = std::max(map.largest, cell.statistic * cell.statistic);
  }
  return map;
}

}  // namespace metastable::analysis
