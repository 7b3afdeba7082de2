#include "analysis/walker_model/step_least_squares.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_effects.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_stepper.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t fewest_residuals = 30, most_residuals = 10000;
constexpr double of_a_failure = 10;      // the residual, in sds, of a step where the map fails and the machine did not
constexpr int most_moves = 20;           // of one fit
constexpr double least_fall = 1e-8;      // of the sum of squares, by its share: a move that brings less is the last
constexpr double shortest_step = 0.01;   // that is tried, as a share of Gauss and Newton's
constexpr double least_scatter = 1e-9;   // of a column, as a share of its largest residual: below it there is none
constexpr double nuisance_step = 1e-3;   // of the sd with which a parameter is known, for differences
constexpr double least_promise = 1;      // fall of n log(sum) to first order, for a fit
constexpr std::size_t most_fits = 5;     // of sets with one more effect
constexpr std::size_t most_effects = 6;  // of a set

// The residuals of a machine's rows: what was measured less what the map foretells from the row before.
class StepResiduals {
 public:
  // @param nominal  hypothesis under which rows from which the map fails are left out
  StepResiduals(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& nominal)
      : machine_(machine), runs_(runs) {
    for (const MachineSensor& sensor : machine.observe) state_of_.push_back(machine.state_index(sensor.state));
    std::size_t number = 0;
    for (std::size_t t = 0; t < runs.trials.size(); ++t) {
      const MachineTrial& trial = runs.trials[t];
      for (std::size_t k = 0; k + 1 < trial.rows.size(); ++k)
        if (is_whole(trial.rows[k]) && is_whole(trial.rows[k + 1])) places_.push_back({t, k, number + k});
      number += steps_of(trial);
    }
    const MachineStepper steps = stepped(nominal);
    std::vector<TransitionPlace> kept;
    for (std::size_t i = 0; i < places_.size(); ++i)
      if (!steps.failed(i)) kept.push_back(places_[i]);
    places_ = std::move(kept);
  }

  // Returns those of the steps [steps x sensors] and of the launches [trials x sensors that have a stated launch]. A
  // row is NaN where the map fails. Shapes depend on the runs alone.
  std::array<Eigen::MatrixXd, 2> of(const MachineHypothesis& h) const {
    const MachineStepper stepper = stepped(h);
    const auto sensors = static_cast<Eigen::Index>(state_of_.size());
    Eigen::MatrixXd steps(static_cast<Eigen::Index>(places_.size()), sensors);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const MachineRow& row = runs_.trials[places_[i].trial].rows[places_[i].row + 1];
      for (Eigen::Index j = 0; j < sensors; ++j)
        steps(static_cast<Eigen::Index>(i), j) = stepper.failed(i) ? std::numeric_limits<double>::quiet_NaN()
                                                                   : state_seen(h, row, j) - foretold(stepper, i, j);
    }
    std::vector<double> launches;
    Eigen::Index launched = 0;
    for (Eigen::Index j = 0; j < sensors; ++j) {
      const auto sensor = static_cast<std::size_t>(j);
      const MachineLaunch* launch = machine_.stated_launch(machine_.observe[sensor].state);
      if (!launch) continue;
      ++launched;
      for (const MachineTrial& trial : runs_.trials)
        if (!trial.rows.empty() && is_whole(trial.rows.front()))
          launches.push_back(state_seen(h, trial.rows.front(), j) -
                             supposed_launch(h, *launch, state_of_[sensor]).mean);
    }
    const Eigen::Index rows = launched > 0 ? static_cast<Eigen::Index>(launches.size()) / launched : 0;
    return {steps, Eigen::Map<const Eigen::MatrixXd>(launches.data(), rows, launched)};
  }

 private:
  static bool is_whole(const MachineRow& row) {
    return std::ranges::all_of(row.seen, [](double x) { return std::isfinite(x); });
  }
  static double state_seen(const MachineHypothesis& h, const MachineRow& row, Eigen::Index sensor) {
    const auto j = static_cast<std::size_t>(sensor);
    return row.seen[j] - (h.bias.empty() ? 0 : h.bias[j]);
  }
  double foretold(const MachineStepper& stepper, std::size_t step, Eigen::Index sensor) const {
    return stepper.next(step)[static_cast<Eigen::Index>(state_of_[static_cast<std::size_t>(sensor)])];
  }

  MachineStepper stepped(const MachineHypothesis& h) const {
    MachineStepper steps(machine_, runs_, h);
    const Eigen::VectorXd mean = Eigen::VectorXd::Zero(machine_.scores);
    Eigen::VectorXd state(static_cast<Eigen::Index>(machine_.states.size()));
    for (const TransitionPlace& place : places_) {
      const MachineRow& row = runs_.trials[place.trial].rows[place.row];
      for (std::size_t j = 0; j < state_of_.size(); ++j)
        state[static_cast<Eigen::Index>(state_of_[j])] = state_seen(h, row, static_cast<Eigen::Index>(j));
      steps.add(place, state, mean);
    }
    steps.run();
    return steps;
  }

  const Machine& machine_;
  const MachineRuns& runs_;
  std::vector<std::size_t> state_of_;  // by sensor
  std::vector<TransitionPlace> places_;
};

// An effect in a set, by one of its variants.
struct SetMember {
  const MachineCandidate* effect = nullptr;
  std::size_t variant = 0;
};

// The least squares of a set: the refitted parameters first, then the values of its members in order.
struct SquaresFit {
  std::vector<SetMember> members;
  Eigen::VectorXd at, residual;
  double moving = 0;  // unknowns that move a residual
  double sum() const { return residual.squaredNorm(); }
};

class SquaresSelection {
 public:
  SquaresSelection(const Machine& machine, const MachineRuns& runs, const std::vector<std::string>& catalogue)
      : machine_(machine),
        effects_(machine_effects(machine, std::make_shared<MachineDesign>(machine_design(machine, runs)))),
        residuals_(machine, runs, hypothesis({}, nominal())) {
    std::erase_if(effects_, [&](const MachineCandidate& one) {
      const Candidate& c = one.candidate;
      return !c.undecidable.empty() || changes_the_state(one) ||
             (!catalogue.empty() && std::ranges::find(catalogue, c.id) == catalogue.end());
    });
    weigh(nominal());
    plain_ = fitted({}, nominal());
    weigh(plain_.at);
    plain_ = fitted({}, plain_.at);
  }

  bool possible() const { return plain_.residual.size() > 0; }

  template <class Criterion>
  std::vector<std::string> chosen(const Criterion& criterion) {
    SquaresFit best = plain_;
    const auto value = [&](const SquaresFit& fit) {
      const auto n = static_cast<double>(fit.residual.size());
      return criterion(-0.5 * n * std::log(fit.sum() / n), parameters_of(fit), n);
    };
    while (best.members.size() < most_effects) {
      const SquaresFit* found = nullptr;
      double least = value(best);
      for (const SquaresFit& fit : one_more(best))
        if (value(fit) < least) least = value(fit), found = &fit;
      if (!found) break;
      best = *found;
    }
    return ids(best.members);
  }

 private:
  static std::vector<std::string> ids(const std::vector<SetMember>& members) {
    std::vector<std::string> all;
    for (const SetMember& member : members) all.push_back(member.effect->candidate.id);
    return all;
  }

  // Says whether it adds to what a point of the map holds: noise that a single step does not show.
  bool changes_the_state(const MachineCandidate& one) const {
    MachineHypothesis h = hypothesis({}, nominal());
    std::vector<double> values;
    for (const FreeParameter& p : one.candidate.parameters) values.push_back(p.neutral + p.step);
    one.apply(h, one.candidate.variants.front(), values);
    return !h.spreads.empty() || !h.memory.empty();
  }

  Eigen::VectorXd nominal() const {
    std::vector<double> all;
    for (const MachineParameter& p : machine_.parameters)
      if (p.sd > 0) all.push_back(p.nominal);
    return Eigen::Map<const Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
  }

  MachineHypothesis hypothesis(const std::vector<SetMember>& members, const Eigen::VectorXd& at) const {
    MachineHypothesis h;
    Eigen::Index slot = 0;
    for (const MachineParameter& p : machine_.parameters) h.values.push_back(p.sd > 0 ? at[slot++] : p.nominal);
    for (const MachineEffect& effect : machine_.effects)
      for (const SuspectedParameter& p : effect.parameters) h.values.push_back(p.neutral);
    for (const SetMember& member : members) {
      const Candidate& candidate = member.effect->candidate;
      std::vector<double> values;
      for (std::size_t i = 0; i < candidate.parameters.size(); ++i) values.push_back(at[slot++]);
      member.effect->apply(h, candidate.variants[member.variant], values);
    }
    return h;
  }

  // Lists what is fitted, with bounds and steps.
  std::vector<FreeParameter> unknowns(const std::vector<SetMember>& members) const {
    std::vector<FreeParameter> all;
    for (const MachineParameter& p : machine_.parameters)
      if (p.sd > 0) all.push_back({p.nominal, p.lower, p.upper, nuisance_step * p.sd});
    for (const SetMember& member : members)
      for (const FreeParameter& p : member.effect->candidate.parameters) all.push_back(p);
    return all;
  }

  // Sets by what the residuals of each column are weighed: their sd.
  void weigh(const Eigen::VectorXd& at) {
    const std::array<Eigen::MatrixXd, 2> all = residuals_.of(hypothesis({}, at));
    for (std::size_t b = 0; b < all.size(); ++b) {
      std::vector<Eigen::Index> kept;
      for (Eigen::Index i = 0; i < all[b].rows(); ++i)
        if (all[b].row(i).allFinite()) kept.push_back(i);
      sd_[b] = Eigen::RowVectorXd::Ones(all[b].cols());
      if (kept.size() < 2) continue;
      Eigen::MatrixXd rows = all[b](kept, Eigen::all);
      rows.rowwise() -= rows.colwise().mean().eval();
      const Eigen::RowVectorXd sd = rows.colwise().norm() / std::sqrt(static_cast<double>(rows.rows()));
      const Eigen::RowVectorXd largest = all[b](kept, Eigen::all).cwiseAbs().colwise().maxCoeff();
      sd_[b] = (sd.array() > least_scatter * largest.array()).select(sd, 1);
    }
  }

  Eigen::VectorXd weighed(const std::vector<SetMember>& members, const Eigen::VectorXd& at) const {
    const std::array<Eigen::MatrixXd, 2> all = residuals_.of(hypothesis(members, at));
    Eigen::VectorXd joined(all[0].size() + all[1].size());
    Eigen::Index first = 0;
    for (std::size_t b = 0; b < all.size(); ++b) {
      const Eigen::MatrixXd in_sds = all[b] * sd_[b].cwiseInverse().asDiagonal();
      joined.segment(first, in_sds.size()) =
          in_sds.reshaped().unaryExpr([](double x) { return std::isfinite(x) ? x : of_a_failure; });
      first += in_sds.size();
    }
    return joined;
  }

  // Returns the slopes of the residuals from an unknown on, by differences into its bounds.
  Eigen::MatrixXd slopes(const SquaresFit& fit, std::size_t from = 0) const {
    const std::vector<FreeParameter> free = unknowns(fit.members);
    Eigen::MatrixXd all(fit.residual.size(), static_cast<Eigen::Index>(free.size() - from));
    for (std::size_t i = from; i < free.size(); ++i) {
      const auto slot = static_cast<Eigen::Index>(i);
      const double step = fit.at[slot] + free[i].step <= free[i].upper ? free[i].step : -free[i].step;
      Eigen::VectorXd moved = fit.at;
      moved[slot] += step;
      all.col(slot - static_cast<Eigen::Index>(from)) = (weighed(fit.members, moved) - fit.residual) / step;
    }
    return all;
  }

  SquaresFit fitted(std::vector<SetMember> members, Eigen::VectorXd start) const {
    SquaresFit fit{std::move(members), std::move(start), {}, 0};
    fit.residual = weighed(fit.members, fit.at);
    const std::vector<FreeParameter> free = unknowns(fit.members);
    if (free.empty()) return fit;
    for (int i = 0; i < most_moves; ++i) {
      Eigen::MatrixXd slope = slopes(fit);
      Eigen::VectorXd size = slope.colwise().norm();
      fit.moving = static_cast<double>((size.array() > 0).count());
      size = (size.array() > 0).select(size, 1);
      slope *= size.cwiseInverse().asDiagonal();
      const Eigen::VectorXd step =
          size.cwiseInverse().asDiagonal() * slope.completeOrthogonalDecomposition().solve(-fit.residual);
      const double before = fit.sum();
      for (double share = 1; share > shortest_step && fit.sum() >= before; share /= 2) {
        Eigen::VectorXd moved = fit.at + share * step;
        for (std::size_t p = 0; p < free.size(); ++p) {
          double& x = moved[static_cast<Eigen::Index>(p)];
          x = std::clamp(x, free[p].lower, free[p].upper);
        }
        Eigen::VectorXd left = weighed(fit.members, moved);
        if (left.squaredNorm() < before) fit.at = std::move(moved), fit.residual = std::move(left);
      }
      if (!(fit.sum() < (1 - least_fall) * before)) break;
    }
    return fit;
  }

  // A set with one more effect, where to start its fit, and the sum of squares that is left there to first order.
  struct Promised {
    std::vector<SetMember> members;
    Eigen::VectorXd start;
    double sum = 0;
  };

  // Returns the best variant of an effect beside a fit. @param directions  orthonormal, of the fit's slopes
  Promised promise(const SquaresFit& fit, const MachineCandidate& effect, const Eigen::MatrixXd& directions) const {
    const std::vector<FreeParameter>& free = effect.candidate.parameters;
    Promised best{{}, {}, fit.sum()};
    for (std::size_t variant = 0; variant < effect.candidate.variants.size(); ++variant) {
      SquaresFit more = fit;
      more.members.push_back({&effect, variant});
      const auto known = fit.at.size(), added = static_cast<Eigen::Index>(free.size());
      more.at.conservativeResize(known + added);
      for (std::size_t p = 0; p < free.size(); ++p) more.at[known + static_cast<Eigen::Index>(p)] = free[p].neutral;
      Eigen::MatrixXd slope = slopes(more, static_cast<std::size_t>(known));
      slope -= directions * (directions.transpose() * slope);
      Eigen::VectorXd values = slope.completeOrthogonalDecomposition().solve(-fit.residual);
      for (std::size_t p = 0; p < free.size(); ++p) {
        double& value = values[static_cast<Eigen::Index>(p)];
        value = std::clamp(value, free[p].lower - free[p].neutral, free[p].upper - free[p].neutral);
      }
      const double left = (fit.residual + slope * values).squaredNorm();
      if (!(left < best.sum)) continue;
      more.at.tail(added) += values;
      best = {std::move(more.members), std::move(more.at), left};
    }
    return best;
  }

  // Returns the fits of a set with one more effect, of those that promise most.
  const std::vector<SquaresFit>& one_more(const SquaresFit& fit) {
    const auto [known, fresh] = tried_.try_emplace(ids(fit.members));
    if (!fresh) return known->second;
    Eigen::MatrixXd directions(fit.residual.size(), 0);
    if (fit.at.size() > 0) {
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(slopes(fit));
      directions =
          qr.householderQ() * Eigen::MatrixXd::Identity(fit.residual.size(), static_cast<Eigen::Index>(qr.rank()));
    }
    std::vector<Promised> promised;
    for (const MachineCandidate& effect : effects_) {
      if (std::ranges::find(fit.members, &effect, &SetMember::effect) != fit.members.end()) continue;
      Promised one = promise(fit, effect, directions);
      const double gain = static_cast<double>(fit.residual.size()) * std::log(fit.sum() / one.sum);
      if (gain > least_promise) promised.push_back(std::move(one));
    }
    std::ranges::stable_sort(promised, {}, &Promised::sum);
    if (promised.size() > most_fits) promised.resize(most_fits);
    for (Promised& one : promised) {
      SquaresFit from_there = fitted(one.members, one.start);
      known->second.push_back(std::move(from_there));
    }
    return known->second;
  }

  // Counts the unknowns that move a residual, the entries of a variant where there is a choice, and the variance.
  static double parameters_of(const SquaresFit& fit) {
    double count = fit.moving + 1;
    for (const SetMember& member : fit.members) {
      const std::vector<std::vector<double>>& variants = member.effect->candidate.variants;
      if (variants.size() > 1) count += static_cast<double>(variants.front().size());
    }
    return count;
  }

  const Machine& machine_;
  std::vector<MachineCandidate> effects_;
  StepResiduals residuals_;
  std::array<Eigen::RowVectorXd, 2> sd_;  // by which the columns of steps and of launches are weighed
  SquaresFit plain_;
  std::map<std::vector<std::string>, std::vector<SquaresFit>> tried_;
};

}  // namespace

std::vector<StepwiseChoice> least_squares_selection(const Machine& machine, const MachineRuns& runs,
                                                    const std::vector<std::string>& catalogue) {
  const auto measured = [&](const std::string& state) {
    return std::ranges::find(machine.observe, state, &MachineSensor::state) != machine.observe.end();
  };
  const std::size_t residuals = runs.transitions() * machine.observe.size();
  if (!std::ranges::all_of(machine.states, measured) || residuals < fewest_residuals || residuals > most_residuals)
    return {};
  SquaresSelection selection(machine, runs, catalogue);
  if (!selection.possible()) return {};
  return {{"Gauss-Newton AICc", selection.chosen(corrected_akaike)}, {"Gauss-Newton BIC", selection.chosen(schwarz)}};
}

}  // namespace metastable::analysis
