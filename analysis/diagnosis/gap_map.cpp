#include "analysis/diagnosis/gap_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "analysis/diagnosis/effect_scan.h"
#include "analysis/diagnosis/map_cells.h"
#include "analysis/statistics/median.h"
#include "analysis/statistics/random.h"
#include "dynamics/wheel/truncated_normal.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double tail_score = 2.2;
constexpr double central_score = 1.5;          // below it an event is in the middle of its distribution
constexpr double least_rests = 3;              // seen or expected, for a statement on them
constexpr std::size_t least_successions = 20;  // of two scores in a trial, for a statement on memory
constexpr double beyond_doubt = 5;             // [standard deviations]
constexpr double least_left = 0.1;      // share of a column that is kept where the fitted parameters explain nearly all
constexpr double usual_critical = 3.5;  // of the largest statistic, where no chance is drawn

// Holds what an event adds to the sums of a cell: functions of its normal score, or their means given that the wheel
// rested (a score below that of the chance of rest) or did not. All have mean zero if the model is right.
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

// Says what a column of the map looks for: how its size follows from its sum.
enum class Measure { shift, spread, tail, correlation, rests };

// Holds the contributions of events to the statistic of one cell and aspect: their sum has mean zero without a gap.
struct Column {
  Measure measure;
  std::vector<std::pair<std::size_t, double>> terms;  // by event
  double variance;                                    // of the sum under the model
  std::vector<double> weights;                        // of a cell that is a contrast; empty: 1
};

// Holds the cells of a map and their columns, in the same order.
struct Columns {
  std::vector<GapCell> cells;
  std::vector<Column> columns;

  void add(const MapCell& cell, const char* aspect, const char* unit, double size, Column column) {
    GapCell out;
    out.facet = cell.facet;
    out.aspect = aspect;
    out.at = cell.at;
    out.unit = unit;
    out.size = size;
    out.events = cell.events.size();
    out.stance = cell.stance;
    out.swing = cell.swing;
    cells.push_back(std::move(out));
    columns.push_back(std::move(column));
  }
};

EventKind phase_of(EventKind kind) { return is_contact(kind) ? EventKind::collision : kind; }

// Returns [rad/s] by phase, contacts as collisions, what a unit of score is in the middle of its distribution. Where a
// cell's events are far out it is more there, and would exaggerate the shift that brought them out. Where none is in
// the middle it is the usual one.
std::map<EventKind, double> units_of_score(const std::vector<Event>& events, const Evaluation& evaluation) {
  std::map<EventKind, std::pair<double, double>> sums;  // and their number
  std::map<EventKind, std::vector<double>> all;
  for (std::size_t i = 0; i < events.size(); ++i) {
    all[phase_of(events[i].kind)].push_back(evaluation.unit[i]);
    if (std::abs(evaluation.score[i]) < central_score) {
      auto& [sum, number] = sums[phase_of(events[i].kind)];
      sum += evaluation.unit[i];
      ++number;
    }
  }
  std::map<EventKind, double> units;
  for (auto& [phase, some] : all) units[phase] = median(std::move(some));
  for (const auto& [phase, sum] : sums) units[phase] = sum.first / sum.second;
  return units;
}

// Adds mean, spread and, of whole phases, tail share of every cell; contrasts have a mean only.
void add_cells(Columns& all, const TransitionModel& model, const std::vector<Residual>& residuals,
               const std::map<EventKind, double>& units) {
  const double share_beyond = 2 * dynamics::normal_cdf(-tail_score);
  for (const MapCell& cell : map_cells(model)) {
    const auto n = static_cast<double>(cell.events.size());
    const auto unit = units.find(phase_of(model.events()[cell.events.front()].kind));
    const double in_speed = unit != units.end() ? unit->second : 1;  // [rad/s] of a score of one
    if (!cell.weights.empty()) {
      Column weighted{Measure::shift, {}, 0, cell.weights};
      for (std::size_t k = 0; k < cell.events.size(); ++k) {
        weighted.terms.emplace_back(cell.events[k], cell.weights[k] * residuals[cell.events[k]].mean);
        weighted.variance += cell.weights[k] * cell.weights[k];
      }
      all.add(cell, "mean", "rad/s", in_speed, std::move(weighted));
      continue;
    }
    Column mean{Measure::shift, {}, n, {}}, spread{Measure::spread, {}, n, {}};
    Column tail{Measure::tail, {}, n * share_beyond * (1 - share_beyond), {}};
    double beyond = 0;
    for (const std::size_t i : cell.events) {
      mean.terms.emplace_back(i, residuals[i].mean);
      spread.terms.emplace_back(i, residuals[i].spread);
      tail.terms.emplace_back(i, residuals[i].tail);
      beyond += residuals[i].tail;
    }
    all.add(cell, "mean", "rad/s", in_speed, std::move(mean));  // the size follows with the statistic
    all.add(cell, "spread", "of the model's", 0, std::move(spread));
    if (cell.facet == "phase") all.add(cell, "tail", "share", beyond / n, std::move(tail));
  }
}

// Adds memory: successive scores of a trial; and trials that differ as a whole. It goes by correlation, so that a model
// far off does not pass for either.
void add_memory(Columns& all, const std::vector<Event>& events, const std::vector<Residual>& residuals, bool stance) {
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < events.size(); ++i)
    if (stance ? is_stance(events[i].kind) : is_contact(events[i].kind)) members.push_back(i);
  double middle = 0, square = 0;
  for (const std::size_t i : members) {
    middle += residuals[i].mean / static_cast<double>(members.size());
    square += residuals[i].mean * residuals[i].mean / static_cast<double>(members.size());
  }
  const double sd = std::sqrt(std::max(1.0, square - middle * middle));
  Column memory{Measure::correlation, {}, 0, {}}, whole{Measure::correlation, {}, 0, {}};
  MapCell successive{"collision", stance ? "successive stances" : "successive collisions", {}, stance};
  MapCell trials{"trial", stance ? "trials as a whole, stance" : "trials as a whole", {}, stance};
  double sum = 0, between = 0, pairs = 0, in_trial = 0, partial = 0, before = 0;
  std::optional<std::size_t> previous;
  for (const std::size_t i : members) {
    const double s = (residuals[i].mean - middle) / sd;
    if (previous && events[*previous].trial == events[i].trial) {
      memory.terms.emplace_back(i, s * before);
      sum += s * before;
      successive.events.push_back(i);
      whole.terms.emplace_back(i, s * partial);  // adds up to half of (sum^2 - sum of squares)
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
  if (memory.terms.size() < least_successions) return;
  memory.variance = static_cast<double>(memory.terms.size());
  whole.variance = pairs;
  const double correlation = sum / memory.variance;
  all.add(successive, "memory", "correlation", correlation, std::move(memory));
  all.add(trials, "spread", "correlation", between / pairs, std::move(whole));
}

// Puts rests against what the model expects at the same speeds.
void add_rests(Columns& all, const TransitionModel& model, const Fit& fit) {
  const auto& events = model.events();
  const std::vector<double> chance_of_rest = model.rest_chances(fit.nuisance, fit.terms);
  std::map<std::size_t, MapCell> outcomes;
  for (std::size_t i = 0; i < events.size(); ++i)
    if (events[i].rested) {
      MapCell& cell = outcomes[events[i].condition];
      cell.facet = "outcome";
      cell.at = "rests in " + model.condition_name(events[i].condition);
      cell.events.push_back(i);
    }
  for (auto& [condition, cell] : outcomes) {
    Column column{Measure::rests, {}, 0, {}};
    double excess = 0, expected = 0, rests = 0;
    for (const std::size_t i : cell.events) {
      column.terms.emplace_back(i, (*events[i].rested ? 1 : 0) - chance_of_rest[i]);
      excess += column.terms.back().second;
      expected += chance_of_rest[i];
      rests += *events[i].rested;
      column.variance += chance_of_rest[i] * (1 - chance_of_rest[i]);
    }
    if (std::max(expected, rests) < least_rests) continue;
    all.add(cell, "mean", "share of collisions", excess / static_cast<double>(cell.events.size()), std::move(column));
  }
}

// Holds columns by event, of which the part that the fitted parameters' scores explain is taken off.
struct Efficient {
  Eigen::MatrixXd dense;          // [events x columns]
  Eigen::RowVectorXd sums;        // of the columns
  Eigen::RowVectorXd whole_norm;  // squared, before anything was taken off
};

// Nuisances move no further than their prior lets them.
Efficient project(const std::vector<Column>& columns, const TransitionModel& model, const Fit& fit) {
  const auto count = static_cast<Eigen::Index>(model.events().size());
  Efficient all{Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(columns.size())), {}, {}};
  for (std::size_t c = 0; c < columns.size(); ++c)
    for (const auto& [i, value] : columns[c].terms)
      all.dense(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) = value;
  all.whole_norm = all.dense.colwise().squaredNorm();
  all.sums = all.dense.colwise().sum();
  if (fit.derivatives.slope.cols() == 0) return all;
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
  const Eigen::MatrixXd weights = markov::solve_columns(gram, held.transpose() * all.dense);
  all.dense -= held * weights;
  all.sums -= left.transpose() * weights;
  return all;
}

// Holds what is drawn anew, and how much trials scatter beyond it.
struct Units {
  Eigen::MatrixXd rows;        // [trials or events x columns]
  Eigen::RowVectorXd scatter;  // of the columns' sums, by the trials' own; 0 where trials are drawn
};

// Trials are drawn anew as wholes; where they are few, transitions are.
Units units_of_chance(const Efficient& efficient, const TransitionModel& model) {
  const Eigen::Index count = efficient.dense.rows(), columns = efficient.dense.cols();
  const auto trials = static_cast<double>(model.trials());
  Units units{Eigen::MatrixXd(), Eigen::RowVectorXd::Zero(columns)};
  Eigen::MatrixXd by_trial = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.trials()), columns);
  for (Eigen::Index i = 0; i < count; ++i)
    by_trial.row(static_cast<Eigen::Index>(model.events()[static_cast<std::size_t>(i)].trial)) +=
        efficient.dense.row(i);
  if (model.trials() >= enough_trials) {
    units.rows = std::move(by_trial);
    return units;
  }
  units.rows = efficient.dense;
  // Few trials that scatter more than their transitions would by themselves widen the scale all the same.
  if (trials > 1) {
    const Eigen::RowVectorXd middle = by_trial.colwise().mean();
    units.scatter = (by_trial.rowwise() - middle).colwise().squaredNorm() * (trials / (trials - 1));
  }
  return units;
}

// Says how much of a shift of the cell the fitted parameters leave, by the slopes of its scores: where the gap is large
// the events' own products say too much.
double left_of_shift(const Column& column, const Fit& fit) {
  Eigen::VectorXd follows = Eigen::VectorXd::Zero(fit.derivatives.change.cols());
  for (std::size_t k = 0; k < column.terms.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(column.terms[k].first);
    follows += (column.weights.empty() ? 1 : column.weights[k]) * fit.derivatives.change.row(i).transpose();
  }
  return 1 - follows.dot(markov::solve_symmetric(fit.information, follows)) / column.variance;
}

// Gives the cells their own statistics, sizes and p-values.
void standardise(std::vector<GapCell>& cells, const std::vector<Column>& columns, const Efficient& efficient,
                 const Units& units, const Fit& fit) {
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const Column& column = columns[k];
    const auto c = static_cast<Eigen::Index>(k);
    // The variance is summed by event: without a gap events are independent, and there are many more than trials.
    const double sum = efficient.sums[c], whole = efficient.whole_norm[c];
    // It is the model's own variance, less the share that the fitted parameters take off: where nothing rare happened
    // (no rest, no far score) the events themselves show almost none.
    // Where nearly all of the column is explained there is nothing left to say: a tenth is kept as the least share.
    const double squares = efficient.dense.col(c).squaredNorm();
    const double kept = whole > 0 ? squares / whole : 1;
    const double own = std::max(kept * column.variance, 1e-24);
    const double scale =
        std::sqrt(std::max({own, squares, units.rows.col(c).squaredNorm(), units.scatter[c], least_left * whole}));
    GapCell& cell = cells[k];
    cell.statistic = std::isfinite(sum) ? sum / scale : 0;  // a fit far off may have no slopes to project on
    // Products of scores spread by what they look for: whether there is anything, the model's own variance tells.
    if (column.measure == Measure::correlation && std::isfinite(sum)) {
      const double plain = std::clamp(sum / std::sqrt(own), -beyond_doubt, beyond_doubt);
      if (std::abs(plain) > std::abs(cell.statistic)) cell.statistic = plain;
    }
    // The efficient size is the score by its information, so that size and statistic have one sign.
    const bool shift = column.measure == Measure::shift;
    const double left = shift && fit.derivatives.change.cols() > 0 ? left_of_shift(column, fit) : kept;
    const double information = std::max(1e-12, std::max(least_left, left) * column.variance);
    if (shift)
      cell.size = sum / information * cell.size;
    else if (column.measure == Measure::spread)
      cell.size = sum / information / std::numbers::sqrt2;
    cell.p_value = std::min(1.0, 2 * dynamics::normal_cdf(-std::abs(cell.statistic)));
  }
}

// Takes the columns around their means, of norm 1: sums of rows times normals are statistics by chance.
Eigen::MatrixXd centred(const Eigen::MatrixXd& rows) {
  const Eigen::RowVectorXd mean = rows.colwise().mean();
  Eigen::MatrixXd all = rows.rowwise() - mean;
  for (Eigen::Index c = 0; c < all.cols(); ++c) {
    const double norm = all.col(c).norm();
    if (norm > 0 && std::isfinite(norm))
      all.col(c) /= norm;
    else
      all.col(c).setZero();
  }
  return all;
}

// Steps down by max-T (Westfall and Young): the largest statistic against the largest by chance, the next against the
// largest of those left, and so on; and the bands that hold all cells at once.
void step_down(std::vector<GapCell>& cells, const std::vector<std::size_t>& order, const Eigen::MatrixXd& rows,
               int draws, std::uint64_t seed) {
  std::vector<int> exceeded(order.size());
  std::vector<double> largest_by_chance;
  for (int draw = 0; draw < draws; ++draw) {
    const std::vector<double> normals = normal_multipliers(
        seed, static_cast<std::uint64_t>(draw), DrawStream::chance_on_map, static_cast<std::size_t>(rows.rows()));
    const Eigen::VectorXd multipliers = Eigen::VectorXd::Map(normals.data(), rows.rows());
    const Eigen::VectorXd chance = rows.transpose() * multipliers;
    double largest = 0;
    for (std::size_t k = order.size(); k-- > 0;) {
      largest = std::max(largest, std::abs(chance[static_cast<Eigen::Index>(order[k])]));
      exceeded[k] += largest >= std::abs(cells[order[k]].statistic);
    }
    largest_by_chance.push_back(largest);
  }
  std::sort(largest_by_chance.begin(), largest_by_chance.end());
  const double critical =
      largest_by_chance.empty() ? usual_critical : largest_by_chance[largest_by_chance.size() * 95 / 100];
  double adjusted = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    GapCell& cell = cells[order[k]];
    double p = (exceeded[k] + 1.0) / (draws + 1.0);
    // Where no draw reached it this takes Sidak's bound from the cell's own p-value, if that is smaller.
    if (exceeded[k] == 0) p = std::min(p, static_cast<double>(order.size() - k) * cell.p_value);
    adjusted = std::max(adjusted, std::min(1.0, p));
    cell.p_adjusted = adjusted;
    const double spread = std::abs(cell.statistic) > 1e-9 ? std::abs(cell.size / cell.statistic) : 0;
    cell.band = critical * spread;
  }
}

// Applies Benjamini and Hochberg's procedure. @param order  of falling statistics
void discover(std::vector<GapCell>& cells, const std::vector<std::size_t>& order) {
  double discovery = 1;
  for (std::size_t k = order.size(); k-- > 0;) {
    GapCell& cell = cells[order[k]];
    discovery = std::min(discovery, cell.p_value * static_cast<double>(order.size()) / static_cast<double>(k + 1));
    cell.false_discovery = discovery;
  }
}

}  // namespace

Eigen::MatrixXd mean_columns(const TransitionModel& model) {
  std::vector<MapCell> cells = map_cells(model);
  std::erase_if(cells, [](const MapCell& cell) { return !cell.weights.empty(); });
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
  std::vector<Residual> residuals;
  for (std::size_t i = 0; i < events.size(); ++i)
    residuals.push_back(residual(events[i].kind, fit.evaluation.score[i], fit.evaluation.log_density[i]));
  Columns all;
  add_cells(all, model, residuals, units_of_score(events, fit.evaluation));
  for (const bool stance : {false, true}) add_memory(all, events, residuals, stance);
  add_rests(all, model, fit);

  GapMap map;
  map.cells = std::move(all.cells);
  if (map.cells.empty()) return map;  // too few transitions for a single cell
  const Efficient efficient = project(all.columns, model, fit);
  const Units units = units_of_chance(efficient, model);
  standardise(map.cells, all.columns, efficient, units, fit);

  std::vector<std::size_t> order(map.cells.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(map.cells[a].statistic) > std::abs(map.cells[b].statistic);
  });
  step_down(map.cells, order, centred(units.rows), draws, seed);
  discover(map.cells, order);
  for (const GapCell& cell : map.cells) map.p_value = std::min(map.p_value, cell.p_adjusted);
  return map;
}

}  // namespace metastable::analysis
