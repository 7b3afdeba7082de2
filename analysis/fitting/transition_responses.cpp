#include "analysis/fitting/transition_responses.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace metastable::analysis {
namespace {

constexpr std::size_t apart = 12;  // The probe moves one of so many transitions.
// Later events that are not asked may hold this share of the information on a transition.
constexpr double forgotten = 1e-5;
constexpr double small_move = 0.05;  // A number is moved by so many standard errors, where the given step is more than
constexpr double too_large = 2;      // so many times that.

// Returns by lag the mean square of what events answer to a transition so many before theirs.
std::array<double, apart> answers_by_lag(const TransitionModel& model, const Derivatives& answers) {
  std::array<double, apart> sum{}, count{};
  for (std::size_t e = 0; e < model.events().size(); ++e) {
    const auto lag = static_cast<std::size_t>(model.events()[e].number - 1) % apart;
    const auto row = static_cast<Eigen::Index>(e);
    sum[lag] += std::pow(answers.change(row, 0), 2) + std::pow(answers.slope(row, 0), 2);
    ++count[lag];
  }
  for (std::size_t lag = 0; lag < apart; ++lag) sum[lag] /= std::max(1.0, count[lag]);
  return sum;
}

}  // namespace

TransitionResponses::TransitionResponses(const TransitionModel& model, const Fit& fit, std::size_t number, double step)
    : model_(model), fit_(fit), number_(number), step_(step), first_{0} {
  for (const std::size_t count : model.transitions()) first_.push_back(first_.back() + count);
  const auto events = static_cast<Eigen::Index>(model.events().size());
  answers_ = {Eigen::MatrixXd::Zero(events, 1), Eigen::MatrixXd::Zero(events, 1)};
  fill_differences(fit.evaluation, moved(apart, 0), step_, 0, answers_);
  const std::array<double, apart> by_lag = answers_by_lag(model, answers_);
  double whole = 0, later = 0;
  for (const double one : by_lag) whole += one;
  for (std::size_t lag = apart; lag-- > 1 && (later += by_lag[lag]) <= forgotten * whole;) lags_ = lag;
  const double known =
      answers_.change.squaredNorm() * static_cast<double>(apart) / static_cast<double>(std::max<std::size_t>(1, lags_));
  const double move = small_move / std::sqrt(std::max(1e-300, known));
  if (step_ > too_large * move) step_ = move;
  answers_ = {Eigen::MatrixXd::Zero(events, static_cast<Eigen::Index>(lags_)),
              Eigen::MatrixXd::Zero(events, static_cast<Eigen::Index>(lags_))};
}

// Moves every so many transitions of each trial, from its `first` on.
Evaluation TransitionResponses::moved(std::size_t every, std::size_t first) const {
  Addition added{number_, std::vector<double>(first_.back(), 0.0)};
  for (std::size_t t = 0; t + 1 < first_.size(); ++t)
    for (std::size_t k = first_[t] + first; k < first_[t + 1]; k += every) added.weights[k] = step_;
  return model_.evaluate_with(fit_.nuisance, fit_.terms, added);
}

void TransitionResponses::evaluate(std::size_t which) {
  fill_differences(fit_.evaluation, moved(lags_, which), step_, static_cast<Eigen::Index>(which), answers_);
}

void TransitionResponses::fill(const Addition& addition, Eigen::Index column, Derivatives& all) const {
  for (Eigen::Index row = 0; row < all.slope.rows(); ++row) {
    const Event& event = model_.events()[static_cast<std::size_t>(row)];
    const auto at = static_cast<std::size_t>(event.number - 1);
    double slope = 0, change = 0;
    for (std::size_t k = at + 1 - std::min(at + 1, lags_); k <= at; ++k) {
      const double weight = addition.weights[first_[event.trial] + k];
      const auto moved = static_cast<Eigen::Index>(k % lags_);
      slope += weight * answers_.slope(row, moved);
      change += weight * answers_.change(row, moved);
    }
    all.slope(row, column) = slope;
    all.change(row, column) = change;
  }
}

}  // namespace metastable::analysis
