#include "analysis/walker_model/leg_turns.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <vector>

#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

// A step is 1 where no row is missing, and 2 where one is. In walks of the laboratory without a lost row, steps took
// 0.65 to 1.2 times, and led 0.59 to 1.18 times, what the usual one does.
constexpr double twice = 1.6;
constexpr std::size_t fewest_steps = 10;

// Both have to be reached for a question. In 16 folders of the laboratory whose legs were alike, some with damping,
// slip, a loss at strikes, a spring at the hip, a slow motor or a swinging load, and with or without lost rows, the
// legs seemed to differ by a square of 0.31 at most. Where one leg had 5 or 15 % more mass, or was 2 mm longer, that
// was 3.6 to 9, and lost rows gained from 67 nats on, but for 2 lost rows with few behind them, which gained 6 and are
// not asked about.
constexpr double least_difference = 1;  // The unit is the square of a step's scatter.
constexpr double least_gain = 12;       // This many nats have to speak for legs that are called the other way round.

constexpr double chance_of_a_turn = 3e-4;  // The legs may turn at each row with this chance.
constexpr double most_of_a_step = 3;       // One step, a stumble too, speaks for one leg by so many nats at most.
constexpr double outlying = 25;            // A step whose squared distance is larger does not count for the scatter.
constexpr double usual_error = 0.1;        // An error that is not stated is this share of the column's sd.
constexpr double difference_step = 1e-4;   // Derivatives move states by so much, in their unit.
constexpr double score_step = 0.5;         // They move scores by so much.
constexpr int rounds = 15;                 // Calls of legs and what lies between these settle in less.

std::string row_of(const MachineRuns& runs, std::size_t trial, std::size_t row) {
  return fmt::format("trial {}, row {}", runs.name_of(trial), row + 1);
}

// Asks about steps that are as long as two in a column that counts on: a clock, or a place.
std::vector<std::string> long_steps(const MachineRuns& runs, double MachineRow::*which, const char* column,
                                    const char* unit) {
  struct Step {
    std::size_t trial, row;
    double length;
  };
  std::vector<Step> steps;
  std::vector<double> lengths;
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (std::size_t k = 1; k < runs.trials[t].rows.size(); ++k) {
      const double length = runs.trials[t].rows[k].*which - runs.trials[t].rows[k - 1].*which;
      if (!std::isfinite(length)) continue;
      steps.push_back({t, k, length});
      lengths.push_back(length);
    }
  if (steps.size() < fewest_steps) return {};
  const double usual = median(lengths);
  std::vector<Step> longer;
  if (usual > 0)
    std::ranges::copy_if(steps, std::back_inserter(longer), [&](const Step& s) { return s.length > twice * usual; });
  if (longer.empty()) return {};
  return {fmt::format(
      "{}: {} is {:.3g} {} behind the row before, where the usual step is {:.3g} {}{}: is a row missing there? Were "
      "steps and legs counted anew behind it, so that the legs of these rows are the other ones?",
      column, row_of(runs, longer.front().trial, longer.front().row), longer.front().length, unit, usual, unit,
      longer.size() > 1 ? fmt::format(" ({} such rows)", longer.size()) : "")};
}

using Index = Eigen::Index;

// Steps between whole rows from which the nominal machine does not fail.
struct Steps {
  // The first has [steps x sensors] what is seen less what the machine makes of the row before, in sds; the second
  // [steps x (1 + sensors)] 1, and the row before in sds from its mean.
  Eigen::MatrixXd left, states;
  Eigen::VectorXd leg;                  // [steps] -1 and 1: the leg that stands, as the file calls it
  std::vector<std::size_t> trial, row;  // They tell the row before.
};

// Steps the nominal machine from measured rows, with states and scores moved.
class NominalMap {
 public:
  NominalMap(const Machine& machine, const MachineRuns& runs) : machine_(machine), runs_(runs) {
    const auto whole = [](const MachineRow& row) {
      return std::ranges::all_of(row.seen, [](double x) { return std::isfinite(x); });
    };
    for (const MachineSensor& sensor : machine.observe) state_of_.push_back(machine.state_index(sensor.state));
    for (std::size_t t = 0; t < runs.trials.size(); ++t)
      for (std::size_t k = 0; k + 1 < runs.trials[t].rows.size(); ++k) {
        const MachineRow& row = runs.trials[t].rows[k];
        if (!whole(row) || !whole(runs.trials[t].rows[k + 1])) continue;
        std::vector<double> state(machine.states.size(), 0.0);
        for (const MachineLaunch& launch : machine.launches) state[machine.state_index(launch.state)] = launch.mean;
        for (std::size_t j = 0; j < state_of_.size(); ++j) state[state_of_[j]] = row.seen[j];
        from_.insert(from_.end(), state.begin(), state.end());
        legs_.push_back(row.inputs.front());
        trial_.push_back(t);
        row_.push_back(k);
      }
    for (const MachineParameter& p : machine.parameters) values_.push_back(p.nominal);
    for (const MachineEffect& effect : machine.effects)
      for (const SuspectedParameter& p : effect.parameters) values_.push_back(p.neutral);
  }

  // Returns the next values of the sensors [rows x sensors], NaN where the machine fails.
  Eigen::MatrixXd next(std::optional<std::size_t> moved_state, double score) const {
    const std::size_t rows = trial_.size(), states = machine_.states.size();
    std::vector<double> from = from_, next(from_.size());
    const std::vector<double> scores(rows * static_cast<std::size_t>(machine_.scores), score);
    if (moved_state)
      for (std::size_t i = 0; i < rows; ++i) from[i * states + *moved_state] += difference_step;
    std::vector<std::uint8_t> failed(rows);
    std::vector<std::span<const double>> values;
    for (const double& value : values_) values.emplace_back(&value, 1);
    values.emplace_back(legs_);
    machine_.step({rows, from, scores, values, next, failed});
    Eigen::MatrixXd seen(static_cast<Index>(rows), static_cast<Index>(state_of_.size()));
    for (Index i = 0; i < seen.rows(); ++i)
      for (Index j = 0; j < seen.cols(); ++j) {
        const auto at = static_cast<std::size_t>(i);
        seen(i, j) = failed[at] ? std::nan("") : next[at * states + state_of_[static_cast<std::size_t>(j)]];
      }
    return seen;
  }

  // Holds the measured rows against the map, each in the sds and the directions that its noise and the errors of its
  // sensors have there.
  Steps steps() const {
    const auto sensors = static_cast<Index>(state_of_.size());
    const Eigen::MatrixXd plain = next({}, 0), pushed = (next({}, score_step) - plain) / score_step;
    std::vector<Eigen::MatrixXd> moved;
    Eigen::VectorXd error(sensors), mean(sensors), sd(sensors);
    for (Index j = 0; j < sensors; ++j) {
      const auto sensor = static_cast<std::size_t>(j);
      const ColumnSpread spread = column_spread(runs_, sensor);
      mean[j] = spread.mean;
      sd[j] = spread.sd > 0 ? spread.sd : 1;
      error[j] = machine_.observe[sensor].sd.value_or(usual_error * sd[j]);
      moved.emplace_back(error[j] * (next(state_of_[sensor], 0) - plain) / difference_step);
    }
    Steps all{Eigen::MatrixXd(plain.rows(), sensors),
              Eigen::MatrixXd::Ones(plain.rows(), sensors + 1),
              Eigen::VectorXd(plain.rows()),
              {},
              {}};
    Index count = 0;
    for (Index i = 0; i < plain.rows(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      const std::vector<MachineRow>& rows = runs_.trials[trial_[at]].rows;
      const Eigen::Map<const Eigen::VectorXd> before(rows[row_[at]].seen.data(), sensors),
          after(rows[row_[at] + 1].seen.data(), sensors);
      Eigen::MatrixXd covariance = pushed.row(i).transpose() * pushed.row(i);
      covariance += error.cwiseAbs2().asDiagonal();
      for (const Eigen::MatrixXd& one : moved) covariance += one.row(i).transpose() * one.row(i);
      const Eigen::LLT<Eigen::MatrixXd> root(covariance);
      const Eigen::VectorXd apart = root.matrixL().solve(after - plain.row(i).transpose());
      if (root.info() != Eigen::Success || !apart.allFinite()) continue;
      all.left.row(count) = apart.transpose();
      all.states.row(count).tail(sensors) = (before - mean).cwiseQuotient(sd).transpose();
      all.leg[count++] = legs_[at] < 1.5 ? -1 : 1;
      all.trial.push_back(trial_[at]);
      all.row.push_back(row_[at]);
    }
    all.left.conservativeResize(count, Eigen::NoChange);
    all.states.conservativeResize(count, Eigen::NoChange);
    all.leg.conservativeResize(count);
    return all;
  }

 private:
  const Machine& machine_;
  const MachineRuns& runs_;
  std::vector<std::size_t> state_of_, trial_, row_;
  std::vector<double> from_, legs_, values_;
};

// The steps say this of the legs, where these are called as `called` says.
struct LegDifference {
  Eigen::VectorXd gain;  // [steps] nats by which each speaks for its leg being called as in the file
  double square = 0;     // mean of the difference's square, in the scatter of a step; 0: not known
};

// Fits what is linear in the state before to the steps, for both legs and for what lies between them.
// @param called  [steps] from -1, legs the other way round, to 1, as in the file
// @param counts  [steps] 0 of a step that lies far out; renewed
LegDifference leg_difference(const Steps& steps, const Eigen::VectorXd& called, Eigen::VectorXd& counts) {
  const Index columns = steps.states.cols();
  Eigen::MatrixXd design(steps.left.rows(), 2 * columns);
  design << steps.states, steps.leg.cwiseProduct(called).asDiagonal() * steps.states;
  const Eigen::MatrixXd fitted =
      (counts.asDiagonal() * design).colPivHouseholderQr().solve(counts.asDiagonal() * steps.left);
  const Eigen::MatrixXd apart = steps.leg.asDiagonal() * (steps.states * fitted.bottomRows(columns)),
                        left = steps.left - steps.states * fitted.topRows(columns);
  const Eigen::VectorXd sign = called.unaryExpr([](double c) { return c < 0 ? -1.0 : 1.0; });
  const Eigen::MatrixXd beside = left - sign.asDiagonal() * apart;
  const Eigen::LLT<Eigen::MatrixXd> scatter(beside.transpose() * counts.asDiagonal() * beside / counts.sum());
  if (scatter.info() != Eigen::Success) return {Eigen::VectorXd::Zero(called.size()), 0};
  const Eigen::MatrixXd far = scatter.matrixL().solve(beside.transpose()),
                        difference = scatter.matrixL().solve(apart.transpose()),
                        scaled = scatter.matrixL().solve(left.transpose());
  LegDifference found;
  found.square = difference.colwise().squaredNorm().transpose().dot(counts) / counts.sum();
  found.gain = 2 * difference.cwiseProduct(scaled).colwise().sum().transpose();
  found.gain = found.gain.cwiseMax(-2 * most_of_a_step).cwiseMin(2 * most_of_a_step);
  counts = far.colwise().squaredNorm().transpose().unaryExpr([](double s) { return s < outlying ? 1.0 : 0.0; });
  return found;
}

// Goes through the steps of one trial forwards and backwards: legs may turn at each, by chance_of_a_turn.
// @param called  [steps] the chance that legs are called as in the file less that of the other way round
// @returns the nats that turns gain over none
double find_turns(const Eigen::Ref<const Eigen::VectorXd>& gain, Eigen::Ref<Eigen::VectorXd> called) {
  const Index count = gain.size();
  Eigen::Matrix2d turn;
  turn << 1 - chance_of_a_turn, chance_of_a_turn, chance_of_a_turn, 1 - chance_of_a_turn;
  const auto says = [&](Index i) { return Eigen::Vector2d(std::exp(0.5 * gain[i]), std::exp(-0.5 * gain[i])); };
  Eigen::MatrixXd forwards(2, count);
  Eigen::Vector2d chance(1, 0);
  double sum = 0;
  for (Index i = 0; i < count; ++i) {
    chance = (turn * chance).cwiseProduct(says(i));
    sum += std::log(chance.sum());
    forwards.col(i) = chance /= chance.sum();
  }
  Eigen::Vector2d behind(1, 1);
  for (Index i = count; i-- > 0;) {
    const Eigen::Vector2d both = forwards.col(i).cwiseProduct(behind);
    called[i] = (both[0] - both[1]) / both.sum();
    behind = turn * behind.cwiseProduct(says(i));
    behind /= behind.sum();
  }
  return sum - 0.5 * gain.sum();
}

// Asks about trials in which the legs differ the other way round from some row on.
std::vector<std::string> reversed_legs(const Machine& machine, const MachineRuns& runs) {
  const Steps steps = NominalMap(machine, runs).steps();
  const Index count = steps.leg.size();
  if (count < 6 * steps.states.cols()) return {};
  Eigen::VectorXd called = Eigen::VectorXd::Ones(count), counts = called;
  double square = 0, gain = 0;
  for (int round = 0; round < rounds; ++round) {
    const LegDifference found = leg_difference(steps, called, counts);
    square = found.square;
    gain = 0;
    const auto trial = [&](Index i) { return steps.trial[static_cast<std::size_t>(i)]; };
    for (Index first = 0, end = 0; first < count; first = end) {
      while (end < count && trial(end) == trial(first)) ++end;
      gain += find_turns(found.gain.segment(first, end - first), called.segment(first, end - first));
    }
  }
  if (!(gain >= least_gain && square >= least_difference)) return {};
  std::vector<std::size_t> first;  // The other leg begins with these steps, one a trial.
  for (std::size_t i = 0; i < steps.trial.size(); ++i)
    if (called[static_cast<Index>(i)] < 0 && (first.empty() || steps.trial[first.back()] != steps.trial[i]))
      first.push_back(i);
  if (first.empty()) return {};
  return {
      fmt::format("phase: from {} on{} one leg goes on as the other one does elsewhere: is a row missing before it, "
                  "behind which steps and legs were counted anew?",
                  row_of(runs, steps.trial[first.front()], steps.row[first.front()]),
                  first.size() > 1 ? fmt::format(" (and from some row of {} more trials on)", first.size() - 1) : "")};
}

}  // namespace

std::vector<std::string> questions_on_leg_turns(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> all = long_steps(runs, &MachineRow::time, "time_s", "s");
  for (const auto& more : {long_steps(runs, &MachineRow::position, "position_m", "m"),
                           machine.inputs.empty() ? std::vector<std::string>{} : reversed_legs(machine, runs)})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace metastable::analysis
