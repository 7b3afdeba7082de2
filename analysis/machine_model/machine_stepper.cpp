#include "analysis/machine_model/machine_stepper.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr std::uint8_t lost_mark = 2;  // it did not fail, and there is no next state

}  // namespace

MachineStepper::MachineStepper(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed)
    : machine_(machine), runs_(runs), supposed_(supposed) {
  for (const MachineParameter& p : machine.parameters) {
    lower_.push_back(p.lower);
    upper_.push_back(p.upper);
  }
  for (const MachineEffect& effect : machine.effects)
    for (const SuspectedParameter& p : effect.parameters) {
      lower_.push_back(p.lower);
      upper_.push_back(p.upper);
    }
  varies_.assign(lower_.size(), 0);
  for (const auto& one : supposed.changes) varies_[one.value] = 1;
  for (const auto& one : supposed.laws) varies_[one.value] = 1;
  for (const auto& one : supposed.spreads) varies_[one.value] = 1;
  values_.resize(lower_.size() + machine.inputs.size());
  std::size_t rows = 0;
  for (const MachineTrial& trial : runs.trials) {
    first_row_.push_back(rows);
    rows += trial.rows.size();
  }
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
    const bool filters = !supposed.filter.empty() && supposed.filter[i] > 0;
    filtered_.push_back(filters ? acting(i) : std::vector<double>{});
  }
}

// Returns what acts of an input that is filtered, by row. A trial begins with what its first row has.
std::vector<double> MachineStepper::acting(std::size_t input) const {
  const double kept = supposed_.filter[input];
  std::vector<double> acts;
  for (std::size_t t = 0; t < runs_.trials.size(); ++t) {
    const bool on = goes_on(runs_, t);
    for (const MachineRow& row : runs_.trials[t].rows) {
      const bool first = &row == &runs_.trials[t].rows.front();
      const double before = first && !on ? row.inputs[input] : acts.back(), here = row.inputs[input];
      acts.push_back(std::isfinite(here) ? kept * before + (1 - kept) * here : before);  // A last row may have none.
    }
  }
  return acts;
}

// Returns an input as it acted `lag` steps before a row; between two rows it goes in a straight line. Before the trial
// it is taken to be what the first row has, unless the trial goes on with the one before.
double MachineStepper::input_at(std::size_t input, const TransitionPlace& place) const {
  const double lag = supposed_.lag.empty() ? 0 : supposed_.lag[input];
  const auto before = [&](std::size_t steps) {
    const RowPlace at = row_before(runs_, place.trial, place.row, steps);
    return filtered_[input].empty() ? runs_.trials[at.trial].rows[at.row].inputs[input]
                                    : filtered_[input][first_row_[at.trial] + at.row];
  };
  const auto whole = static_cast<std::size_t>(lag);
  const double rest = lag - static_cast<double>(whole);
  return rest > 0 ? (1 - rest) * before(whole) + rest * before(whole + 1) : before(whole);
}

void MachineStepper::clear() {
  places_.clear();
  states_.clear();
  scores_.clear();
  pushed_.clear();
  next_.clear();
  failed_.clear();
  for (std::vector<double>& one : values_) one.clear();
}

double MachineStepper::value_at(std::size_t value, const TransitionPlace& place,
                                const Eigen::Ref<const Eigen::VectorXd>& point) const {
  double x = supposed_.values[value];
  for (const auto& one : supposed_.changes)
    if (one.value == value) x += one.transition[place.number];
  for (const auto& one : supposed_.laws)
    if (one.value == value) x += one.slope * (point[static_cast<Eigen::Index>(one.state)] - one.centre);
  for (std::size_t i = 0; i < supposed_.spreads.size(); ++i)
    if (supposed_.spreads[i].value == value) x += point[static_cast<Eigen::Index>(states() + i)];
  return std::clamp(x, lower_[value], upper_[value]);
}

MachineStepper MachineStepper::another() const {
  MachineStepper other(machine_, runs_, supposed_);
  other.turns_ = turns_;
  return other;
}

void MachineStepper::turn(std::size_t trial, ScoreTurn turn) {
  turns_.resize(runs_.trials.size());
  turns_[trial] = std::move(turn);
}

void MachineStepper::add(const TransitionPlace& place, const Eigen::Ref<const Eigen::VectorXd>& point,
                         const Eigen::Ref<const Eigen::VectorXd>& fresh) {
  if (turns_.empty() || !turns_[place.trial]) return add_straight(place, point, fresh);
  const ScoreTurn& turn = *turns_[place.trial];
  const Eigen::Index rows = turn.column + 1;
  const Eigen::VectorXd off = point.head(rows) - turn.mean.head(rows);
  // Columns without variance of their own are zero: nothing is along them.
  Eigen::VectorXd along = Eigen::VectorXd::Zero(rows);
  for (Eigen::Index i = 0; i < rows; ++i)
    if (turn.root(i, i) > 0) along[i] = (off[i] - turn.root.row(i).head(i).dot(along.head(i))) / turn.root(i, i);
  const auto score = static_cast<Eigen::Index>(turn.score);
  const double w = along[turn.column], u = fresh[score];
  Eigen::VectorXd turned = fresh;
  turned[score] = (u - turn.ratio * w) / turn.length();
  const double y = (turn.ratio * u + w) / turn.length();
  add_straight(place, point + (y - w) * turn.root.col(turn.column), turned);
}

void MachineStepper::add_straight(const TransitionPlace& place, const Eigen::Ref<const Eigen::VectorXd>& point,
                                  const Eigen::Ref<const Eigen::VectorXd>& fresh) {
  places_.push_back(place);
  states_.insert(states_.end(), point.data(), point.data() + states());
  const double scatter = supposed_.scatter.empty() ? 1 : supposed_.scatter[place.number];
  for (std::size_t m = 0; m < scores(); ++m) {
    const double kept = memory(m);
    const auto at = static_cast<Eigen::Index>(m);
    double z = fresh[at];
    if (kept != 0)
      z = kept * point[static_cast<Eigen::Index>(states() + offsets()) + at] + std::sqrt(1 - kept * kept) * z;
    scores_.push_back(scatter * z);
  }
  for (std::size_t i = 0; i < supposed_.push_spreads.size(); ++i)
    pushed_.push_back(supposed_.push_spreads[i].transition[place.number] *
                      point[static_cast<Eigen::Index>(states() + value_offsets() + i)]);
  for (std::size_t v = 0; v < lower_.size(); ++v)
    if (varies_[v]) values_[v].push_back(value_at(v, place, point));
  for (std::size_t i = 0; i < machine_.inputs.size(); ++i) values_[lower_.size() + i].push_back(input_at(i, place));
}

// Stores what the map returned for a point, with the pushes added.
void MachineStepper::take(std::size_t point, std::span<const double> next, std::uint8_t failed) {
  std::ranges::copy(next, next_.begin() + static_cast<std::ptrdiff_t>(point * states()));
  failed_[point] = failed;
  if (failed) return;
  if (!std::ranges::all_of(next, [](double x) { return std::isfinite(x); })) failed_[point] = lost_mark;
  for (const auto& push : supposed_.pushes)
    next_[point * states() + push.state] += push.transition[places_[point].number];
  for (const auto& one : supposed_.hidden)
    next_[point * states() + one.pushes] += one.pull * one.ahead[places_[point].number];
  const std::size_t count = supposed_.push_spreads.size();
  for (std::size_t i = 0; i < count; ++i)
    next_[point * states() + supposed_.push_spreads[i].state] += pushed_[point * count + i];
}

void MachineStepper::run() {
  std::vector<std::size_t> all(places_.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  run(all);
}

void MachineStepper::run(std::span<const std::size_t> points) {
  const std::size_t rows = points.size();
  next_.resize(places_.size() * states());
  failed_.resize(places_.size());
  std::vector<double> from, scores, next(rows * states());
  std::vector<std::uint8_t> failed(rows);
  std::vector<std::vector<double>> values(values_.size());
  for (std::size_t v = 0; v < lower_.size(); ++v)
    if (!varies_[v]) values[v] = {std::clamp(supposed_.values[v], lower_[v], upper_[v])};
  const auto add = [](std::vector<double>& to, const std::vector<double>& all, std::size_t point, std::size_t each) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(point * each);
    to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(each));
  };
  for (const std::size_t point : points) {
    add(from, states_, point, states());
    add(scores, scores_, point, this->scores());
    for (std::size_t v = 0; v < values.size(); ++v)
      if (v >= lower_.size() || varies_[v]) values[v].push_back(values_[v][point]);
  }
  const std::vector<std::span<const double>> spans(values.begin(), values.end());
  machine_.step({rows, from, scores, spans, next, failed});
  for (std::size_t i = 0; i < rows; ++i) take(points[i], std::span(next).subspan(i * states(), states()), failed[i]);
}

void MachineStepper::tell(std::size_t point, const Eigen::Ref<const Eigen::VectorXd>& next) {
  std::copy_n(next.data(), states(), next_.begin() + static_cast<std::ptrdiff_t>(point * states()));
  failed_[point] = 0;
}

bool MachineStepper::lost(std::size_t point) const { return failed_[point] == lost_mark; }

Eigen::Map<const Eigen::VectorXd> MachineStepper::next(std::size_t point) const {
  return {next_.data() + point * states(), static_cast<Eigen::Index>(states())};
}

}  // namespace metastable::analysis
