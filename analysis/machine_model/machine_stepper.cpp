#include "analysis/machine_model/machine_stepper.h"

#include <algorithm>
#include <cmath>
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
}

void MachineStepper::clear() {
  places_.clear();
  states_.clear();
  scores_.clear();
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
  for (std::size_t v = 0; v < lower_.size(); ++v)
    if (varies_[v]) values_[v].push_back(value_at(v, place, point));
  const MachineRow& row = runs_.trials[place.trial].rows[place.row];
  for (std::size_t i = 0; i < row.inputs.size(); ++i) values_[lower_.size() + i].push_back(row.inputs[i]);
}

void MachineStepper::run() {
  const std::size_t rows = places_.size();
  for (std::size_t v = 0; v < lower_.size(); ++v)
    if (!varies_[v]) values_[v] = {std::clamp(supposed_.values[v], lower_[v], upper_[v])};
  next_.assign(rows * states(), 0.0);
  failed_.assign(rows, 0);
  const std::vector<std::span<const double>> spans(values_.begin(), values_.end());
  machine_.step({rows, states_, scores_, spans, next_, failed_});
  for (std::size_t i = 0; i < rows; ++i) {
    if (failed_[i]) continue;
    for (std::size_t s = 0; s < states(); ++s)
      if (!std::isfinite(next_[i * states() + s])) failed_[i] = lost_mark;
    for (const auto& push : supposed_.pushes) next_[i * states() + push.state] += push.transition[places_[i].number];
  }
}

bool MachineStepper::lost(std::size_t point) const { return failed_[point] == lost_mark; }

Eigen::Map<const Eigen::VectorXd> MachineStepper::next(std::size_t point) const {
  return {next_.data() + point * states(), static_cast<Eigen::Index>(states())};
}

}  // namespace metastable::analysis
