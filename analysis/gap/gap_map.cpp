#include "analysis/gap/gap_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

#include "analysis/fitting/effect_scan.h"
#include "analysis/gap/map_columns.h"
#include "analysis/statistics/falling_order.h"
#include "analysis/statistics/random.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double beyond_doubt = 5;      // [standard deviations]
constexpr double least_left = 0.1;      // share of a column that is kept where the fitted parameters explain nearly all
constexpr double usual_critical = 3.5;  // of the largest statistic, where no chance is drawn

// Holds what is drawn anew, and how much trials scatter beyond it.
struct Units {
  Eigen::MatrixXd rows;        // [trials or events x columns]
  Eigen::RowVectorXd scatter;  // of the columns' sums, by the trials' own; 0 where trials are drawn
};

// Trials are drawn anew as wholes; where they are few, transitions are.
Units units_of_chance(const EfficientColumns& efficient, const TransitionModel& model) {
  const Eigen::Index count = efficient.dense.rows(), columns = efficient.dense.cols();
  const auto trials = static_cast<double>(model.trials());
  Units units{Eigen::MatrixXd(), Eigen::RowVectorXd::Zero(columns)};
  Eigen::MatrixXd by_trial = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.trials()), columns);
  for (Eigen::Index i = 0; i < count; ++i)
    by_trial.row(static_cast<Eigen::Index>(model.events()[static_cast<std::size_t>(i)].trial)) +=
        efficient.dense.row(i);
  if (model.trials() >= Rules::enough_trials) {
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
// @param root  of the inverse of their information
double left_of_shift(const MapColumn& column, const Fit& fit, const Eigen::MatrixXd& root) {
  Eigen::VectorXd follows = Eigen::VectorXd::Zero(fit.derivatives.change.cols());
  for (std::size_t k = 0; k < column.terms.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(column.terms[k].first);
    follows += (column.weights.empty() ? 1 : column.weights[k]) * fit.derivatives.change.row(i).transpose();
  }
  return 1 - (root.transpose() * follows).squaredNorm() / column.variance;
}

// Returns the standard normal of a spread larger than the model's: where scores spread by `ratio` of their variance,
// their squares do, too, and the sum of these weighed by their own scatter would not pass a few standard deviations. So
// the ratio is held against a chi-square's, by Wilson and Hilferty (1931), with fewer degrees of freedom where squares
// scatter more than those of normal scores: by a factor of `excess`.
double larger_spread(double ratio, double events, double excess) {
  const double degrees = events / std::max(1.0, excess), part = 2 / (9 * degrees);
  return (std::cbrt(ratio) - 1 + part) / std::sqrt(part);
}

// Returns what tells the phase and the column of some events from others.
std::tuple<bool, bool, std::size_t> phase_of(const MapColumn& column, const TransitionModel& model) {
  const Event& one = model.events()[column.terms.front().first];
  return {one.kind == EventKind::launch, is_stance(one.kind), one.column};
}

// Returns, for each phase, by what factor squares of its scores scatter more than those of normal ones. A cell of few
// events may lack the far ones.
std::map<std::tuple<bool, bool, std::size_t>, double> excess_by_phase(const std::vector<GapCell>& cells,
                                                                      const std::vector<MapColumn>& columns,
                                                                      const TransitionModel& model) {
  std::map<std::tuple<bool, bool, std::size_t>, double> excess;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (!cells[k].of_all() || columns[k].measure != Measure::spread) continue;
    double sum = 0, squares = 0;
    for (const auto& [event, value] : columns[k].terms) sum += value, squares += value * value;
    const auto n = static_cast<double>(columns[k].terms.size());
    double& most = excess[phase_of(columns[k], model)];
    most = std::max(most, (squares / n - std::pow(sum / n, 2)) / std::pow(1 + std::numbers::sqrt2 * sum / n, 2));
  }
  return excess;
}

// Returns the mean score of the events whose spread is column k: a shift spreads squares about zero, too. The column of
// a cell's mean stands before that of its spread.
double mean_of_cell(const std::vector<MapColumn>& columns, std::size_t k) {
  if (k == 0 || columns[k - 1].measure != Measure::shift || columns[k - 1].terms.size() != columns[k].terms.size())
    return 0;
  double sum = 0;
  for (const auto& [event, score] : columns[k - 1].terms) sum += score;
  return sum / static_cast<double>(columns[k].terms.size());
}

std::size_t trials_of(const MapColumn& column, const TransitionModel& model) {
  std::set<std::size_t> trials;
  for (const auto& term : column.terms) trials.insert(model.events()[term.first].trial);
  return trials.size();
}

// Gives the cells their own statistics, sizes and p-values.
void standardise(std::vector<GapCell>& cells, const std::vector<MapColumn>& columns, const EfficientColumns& efficient,
                 const Units& units, const Fit& fit, const TransitionModel& model) {
  const auto excess = excess_by_phase(cells, columns, model);
  const Eigen::MatrixXd root = fit.information.rows() > 0 ? resolved_root(fit.information) : fit.information;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const MapColumn& column = columns[k];
    const auto c = static_cast<Eigen::Index>(k);
    // The variance is summed by event: without a gap events are independent, and there are many more than trials.
    const double sum = efficient.sums[c], whole = efficient.whole_norm[c];
    // It is the model's own variance, less the share that the fitted parameters take off: where nothing rare happened
    // (no rest, no far score) the events themselves show almost none.
    // Where nearly all of the column is explained there is nothing left to say: a tenth is kept as the least share.
    const double squares = efficient.dense.col(c).squaredNorm();
    const double kept = whole > 0 ? squares / whole : 1;
    const double own = std::max(kept * column.variance, 1e-24);
    const double by_trial = std::max(units.rows.col(c).squaredNorm(), units.scatter[c]);
    const double scale =
        std::sqrt(std::max({own, squares, by_trial, least_left * whole}) + efficient.by_prior.col(c).squaredNorm());
    GapCell& cell = cells[k];
    cell.statistic = std::isfinite(sum) ? sum / scale : 0;  // a fit far off may have no slopes to project on
    // Products of scores spread by what they look for: whether there is anything, the model's own variance tells.
    if (column.measure == Measure::correlation && std::isfinite(sum)) {
      const double plain = std::clamp(sum / std::sqrt(own), -beyond_doubt, beyond_doubt);
      if (std::abs(plain) > std::abs(cell.statistic)) cell.statistic = plain;
    }
    if (column.measure == Measure::spread && sum > 0 && std::isfinite(sum)) {
      const double left = std::max(least_left, kept) * column.variance, middle = mean_of_cell(columns, k);
      const double ratio = std::max(0.1, 1 + std::numbers::sqrt2 * sum / left - middle * middle);
      const double scatter = std::max(squares - sum * sum / static_cast<double>(column.terms.size()),
                                      by_trial - sum * sum / static_cast<double>(trials_of(column, model)));
      const auto of_phase = excess.find(phase_of(column, model));
      const double most = std::max(scatter / (left * ratio * ratio), of_phase == excess.end() ? 1 : of_phase->second);
      cell.statistic = std::max(cell.statistic, std::min(beyond_doubt, larger_spread(ratio, left, most)));
    }
    // The efficient size is the score by its information, so that size and statistic have one sign.
    const bool shift = column.measure == Measure::shift;
    const double left = shift && fit.derivatives.change.cols() > 0 ? left_of_shift(column, fit, root) : kept;
    const double information = std::max(1e-12, std::max(least_left, left) * column.variance);
    if (shift)
      cell.size = sum / information * cell.size;
    else if (column.measure == Measure::spread)
      cell.size = sum / information / std::numbers::sqrt2;
    cell.p_value = std::min(1.0, 2 * dynamics::normal_cdf(-std::abs(cell.statistic)));
  }
}

// Returns rows whose sums, each row times a standard normal, are statistics by chance: `rows` around their means, so
// that a gap does not count as chance, and below them `by_prior`. Every column has norm 1.
Eigen::MatrixXd drawn_anew(const Eigen::MatrixXd& rows, const Eigen::MatrixXd& by_prior) {
  const Eigen::RowVectorXd mean = rows.colwise().mean();
  Eigen::MatrixXd all(rows.rows() + by_prior.rows(), rows.cols());
  all << rows.rowwise() - mean, by_prior;
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
  MapColumns all = map_columns(model, fit);

  GapMap map;
  map.cells = std::move(all.cells);
  if (map.cells.empty()) return map;  // too few transitions for a single cell
  const EfficientColumns efficient = project(all.columns, model, fit);
  const Units units = units_of_chance(efficient, model);
  standardise(map.cells, all.columns, efficient, units, fit, model);

  std::vector<double> sizes;
  for (const GapCell& cell : map.cells) sizes.push_back(std::abs(cell.statistic));
  const std::vector<std::size_t> order = falling_order(sizes);
  step_down(map.cells, order, drawn_anew(units.rows, efficient.by_prior), draws, seed);
  discover(map.cells, order);
  for (const GapCell& cell : map.cells) map.p_value = std::min(map.p_value, cell.p_adjusted);
  return map;
}

}  // namespace metastable::analysis
