#include "analysis/gap/map_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "analysis/statistics/median.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double tail_score = 2.2;
constexpr double central_score = 1.5;           // below it an event is in the middle of its distribution
constexpr double least_rests = 3;               // seen or expected, for a statement on them
constexpr std::size_t least_successions = 20;   // of two scores in a trial, for a statement on memory
constexpr std::size_t most_paired_columns = 6;  // A machine with more has too many pairs.

EventResidual residual(EventKind kind, double score, double log_density) {
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

using UnitKey = std::pair<EventKind, std::size_t>;  // phase and column

UnitKey phase_of(const Event& e) { return {is_contact(e.kind) ? EventKind::collision : e.kind, e.column}; }

// Returns, in units of the column, by phase, contacts as collisions, what a unit of score is in the middle of its
// distribution. Where a cell's events are far out it is more there, and would exaggerate the shift that brought them
// out. Where none is in the middle it is the usual one.
std::map<UnitKey, double> units_of_score(const std::vector<Event>& events, const Evaluation& evaluation) {
  std::map<UnitKey, std::pair<double, double>> sums;  // and their number
  std::map<UnitKey, std::vector<double>> all;
  for (std::size_t i = 0; i < events.size(); ++i) {
    all[phase_of(events[i])].push_back(evaluation.unit[i]);
    if (std::abs(evaluation.score[i]) < central_score) {
      auto& [sum, number] = sums[phase_of(events[i])];
      sum += evaluation.unit[i];
      ++number;
    }
  }
  std::map<UnitKey, double> units;
  for (auto& [phase, some] : all) units[phase] = median(std::move(some));
  for (const auto& [phase, sum] : sums) units[phase] = sum.first / sum.second;
  return units;
}

// Adds mean, spread and, of whole phases, tail share of every cell; contrasts have a mean only.
void add_cells(MapColumns& all, const TransitionModel& model, const std::vector<EventResidual>& residuals,
               const std::map<UnitKey, double>& units) {
  const std::vector<ObservedColumn> columns = model.columns();
  const double share_beyond = 2 * dynamics::normal_cdf(-tail_score);
  for (const MapCell& cell : map_cells(model)) {
    const auto n = static_cast<double>(cell.events.size());
    const Event& one = model.events()[cell.events.front()];
    const auto unit = units.find(phase_of(one));
    const double in_speed = unit != units.end() ? unit->second : 1;  // of a score of one, in the column's unit
    const std::string& word = columns[one.column].unit.empty() ? columns[one.column].name : columns[one.column].unit;
    if (!cell.weights.empty()) {
      MapColumn weighted{Measure::shift, {}, 0, cell.weights};
      for (std::size_t k = 0; k < cell.events.size(); ++k) {
        weighted.terms.emplace_back(cell.events[k], cell.weights[k] * residuals[cell.events[k]].mean);
        weighted.variance += cell.weights[k] * cell.weights[k];
      }
      all.add(cell, "mean", word, in_speed, std::move(weighted));
      continue;
    }
    MapColumn mean{Measure::shift, {}, n, {}}, spread{Measure::spread, {}, n, {}};
    MapColumn tail{Measure::tail, {}, n * share_beyond * (1 - share_beyond), {}};
    double beyond = 0;
    for (const std::size_t i : cell.events) {
      mean.terms.emplace_back(i, residuals[i].mean);
      spread.terms.emplace_back(i, residuals[i].spread);
      tail.terms.emplace_back(i, residuals[i].tail);
      beyond += residuals[i].tail;
    }
    all.add(cell, "mean", word, in_speed, std::move(mean));  // the size follows with the statistic
    all.add(cell, "spread", "of the model's", 0, std::move(spread));
    if (holds_all(cell.facet, cell.at)) all.add(cell, "tail", "share", beyond / n, std::move(tail));
  }
}

// Adds memory: successive scores of a trial; and trials that differ as a whole. It goes by correlation, so that a model
// far off does not pass for either.
void add_memory(MapColumns& all, const TransitionModel& model, const std::vector<EventResidual>& residuals,
                const EventPhase& phase) {
  const std::vector<Event>& events = model.events();
  const std::vector<std::size_t>& members = phase.members;
  const bool stance = phase.stance;
  const std::string column = model.columns().size() > 1 ? phase.where : "";
  double middle = 0, square = 0;
  for (const std::size_t i : members) {
    middle += residuals[i].mean / static_cast<double>(members.size());
    square += residuals[i].mean * residuals[i].mean / static_cast<double>(members.size());
  }
  const double sd = std::sqrt(std::max(1.0, square - middle * middle));
  MapColumn memory{Measure::correlation, {}, 0, {}}, whole{Measure::correlation, {}, 0, {}};
  MapCell successive{
      model.step_name(), "successive " + (stance ? "stance" : model.step_name()) + "s" + column, {}, stance};
  MapCell trials{"trial", (stance ? "trials as a whole, stance" : "trials as a whole") + column, {}, stance};
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

// Adds correlations of the columns of a machine: two in one step, and one with another a step later. An error of a
// sensor moves several at once, and what is predicted from it as well.
void add_pairs(MapColumns& all, const TransitionModel& model, const std::vector<EventResidual>& residuals,
               const std::vector<EventPhase>& phases) {
  if (phases.size() < 2 || phases.size() > most_paired_columns) return;
  using Row = std::pair<std::size_t, int>;  // These are the trial and the number of a step.
  struct Scored {
    std::size_t event;
    double score;
  };
  std::vector<std::map<Row, Scored>> scored(phases.size());
  for (std::size_t p = 0; p < phases.size(); ++p)
    for (const std::size_t i : phases[p].members)
      scored[p][{model.events()[i].trial, model.events()[i].number}] = {i, residuals[i].mean};
  for (auto& column : scored) {
    double middle = 0, square = 0;
    for (const auto& [row, one] : column) middle += one.score / static_cast<double>(column.size());
    for (const auto& [row, one] : column)
      square += std::pow(one.score - middle, 2) / static_cast<double>(column.size());
    for (auto& [row, one] : column) one.score = (one.score - middle) / std::sqrt(std::max(1.0, square));
  }
  for (std::size_t a = 0; a < phases.size(); ++a)
    for (std::size_t b = 0; b < phases.size(); ++b)
      for (const int later : {0, 1}) {
        if (a == b || (later == 0 && a > b)) continue;
        MapCell cell{"pair of columns",
                     fmt::format(fmt::runtime(later == 1 ? "{}, then {} a {} later" : "{} and {} of one {}"),
                                 model.columns()[phases[a].column].name, model.columns()[phases[b].column].name,
                                 model.step_name()),
                     {},
                     phases[b].stance};
        MapColumn together{Measure::correlation, {}, 0, {}};
        double sum = 0;
        for (const auto& [row, one] : scored[b]) {
          const auto other = scored[a].find({row.first, row.second - later});
          if (other == scored[a].end()) continue;
          together.terms.emplace_back(one.event, one.score * other->second.score);
          sum += together.terms.back().second;
          cell.events.push_back(one.event);
        }
        if (together.terms.size() < least_successions) continue;
        together.variance = static_cast<double>(together.terms.size());
        const double correlation = sum / together.variance;
        all.add(cell, "correlation", "correlation", correlation, std::move(together));
      }
}

// Puts rests against what the model expects at the same speeds.
void add_rests(MapColumns& all, const TransitionModel& model, const Fit& fit) {
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
    MapColumn column{Measure::rests, {}, 0, {}};
    double excess = 0, expected = 0, rests = 0;
    for (const std::size_t i : cell.events) {
      column.terms.emplace_back(i, (*events[i].rested ? 1 : 0) - chance_of_rest[i]);
      excess += column.terms.back().second;
      expected += chance_of_rest[i];
      rests += *events[i].rested;
      column.variance += chance_of_rest[i] * (1 - chance_of_rest[i]);
    }
    if (std::max(expected, rests) < least_rests) continue;
    all.add(cell, "mean", "share of " + model.step_name() + "s", excess / static_cast<double>(cell.events.size()),
            std::move(column));
  }
}

}  // namespace

std::vector<EventResidual> residuals(const TransitionModel& model, const Evaluation& evaluation) {
  std::vector<EventResidual> all;
  for (std::size_t i = 0; i < model.events().size(); ++i)
    all.push_back(residual(model.events()[i].kind, evaluation.score[i], evaluation.log_density[i]));
  return all;
}

MapColumns map_columns(const TransitionModel& model, const Fit& fit) {
  const std::vector<EventResidual> left = residuals(model, fit.evaluation);
  MapColumns all;
  add_cells(all, model, left, units_of_score(model.events(), fit.evaluation));
  const std::vector<EventPhase> phases = event_phases(model);
  for (const EventPhase& phase : phases) add_memory(all, model, left, phase);
  if (model.columns().size() > 1) add_pairs(all, model, left, phases);
  add_rests(all, model, fit);
  return all;
}

// Parameters move no further than their priors let them.
EfficientColumns project(const std::vector<MapColumn>& columns, const TransitionModel& model, const Fit& fit) {
  const auto count = static_cast<Eigen::Index>(model.events().size());
  const auto width = static_cast<Eigen::Index>(columns.size());
  EfficientColumns all{Eigen::MatrixXd::Zero(count, width), {}, {}, Eigen::MatrixXd(0, width)};
  for (std::size_t c = 0; c < columns.size(); ++c)
    for (const auto& [i, value] : columns[c].terms)
      all.dense(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) = value;
  all.whole_norm = all.dense.colwise().squaredNorm();
  all.sums = all.dense.colwise().sum();
  if (fit.derivatives.slope.cols() == 0) return all;
  const Eigen::MatrixXd& held = fit.derivatives.slope;
  Eigen::MatrixXd gram = held.transpose() * held;
  Eigen::VectorXd left = fit.gradient;  // next to nothing
  for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
    const Nuisance& n = model.nuisances()[p];
    const auto at = static_cast<Eigen::Index>(p);
    gram(at, at) += n.information(fit.nuisance[p]);
    if (fit.nuisance[p] <= n.lower || fit.nuisance[p] >= n.upper) left[at] = 0;
  }
  auto at = static_cast<Eigen::Index>(fit.nuisance.size());
  for (const EffectTerm& term : fit.terms)
    for (const FreeParameter& p : term.candidate->parameters) {
      if (p.prior_sd > 0) gram(at, at) += 1 / (p.prior_sd * p.prior_sd);
      ++at;
    }
  const Eigen::MatrixXd root = resolved_root(gram);
  const Eigen::MatrixXd weights = root * (root.transpose() * (held.transpose() * all.dense));
  all.dense -= held * weights;
  all.sums -= left.transpose() * weights;
  all.by_prior = prior_scatter(model, fit).asDiagonal() * weights;
  return all;
}

}  // namespace metastable::analysis
