#include "analysis/machine_model/machine_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "analysis/machine_model/belief_step.h"
#include "analysis/statistics/median.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double least_share = 1e-9;  // of a column's spread, that is taken for its error where there is none
constexpr double least_chance = 1e-300;
constexpr double surely = 1 - 1e-12;  // A chance of failure counts no further.
constexpr SeenValue out_of_reach{least_log_density, farthest_score, 1};

bool unseen(const MachineRow& row) {
  return std::ranges::all_of(row.seen, [](double x) { return std::isnan(x); });
}

// Several columns of a row are moved by the same noise: seen one after another, they need to know how they bend.
int bent_numbers(const Machine& machine, const ScorePlan& plan) {
  return machine.observe.size() > 1 ? static_cast<int>(plan.lattice.size()) : 0;
}

// Says how the values of first rows scatter, whatever a few of them are.
NormalLaunch usual_first_row(const MachineRuns& runs, std::size_t sensor) {
  std::vector<double> values;
  for (const MachineTrial& trial : runs.trials)
    if (!trial.rows.empty() && !std::isnan(trial.rows.front().seen[sensor]))
      values.push_back(trial.rows.front().seen[sensor]);
  if (values.empty()) return {0, column_spread(runs, sensor).sd};
  const double middle = median(values);
  return {middle, median_deviation_to_sd * median_deviation(std::move(values))};
}

// Joins what comes of a step from another beginning, which has this share.
template <int Most>
void take_beside(AfterStep<Most>& after, AfterStep<Most> other, double share) {
  after.belief.add(std::move(other.belief), share);
  after.failed += share * (other.failed - after.failed);
  after.failed_wide += share * (other.failed_wide - after.failed_wide);
}

// Follows all trials of the runs under one hypothesis.
template <int Most>
class Follower {
 public:
  using Part = typename BeliefMixture<Most>::Part;

  Follower(const Machine& machine, const MachineRuns& runs, const ScorePlan& plan, const MachineHypothesis& supposed)
      : machine_(machine), runs_(runs), plan_(plan), supposed_(supposed), stepper_(machine, runs, supposed) {
    for (std::size_t j = 0; j < machine.observe.size(); ++j) {
      state_.push_back(static_cast<Eigen::Index>(machine.state_index(machine.observe[j].state)));
      shared_.push_back(machine.observe[j].correlation != 0 ? shared_count_++ : -1);
      scale_.push_back(column_spread(runs, j).sd);
      stated_.push_back(machine.stated_launch(machine.observe[j].state));
      first_rows_.push_back(usual_first_row(runs, j));
    }
    bent_ = bent_numbers(machine, plan);
    std::size_t number = 0;
    for (const MachineTrial& trial : runs.trials) {
      first_.push_back(number);
      number += steps_of(trial);
    }
  }

  Evaluation follow(const std::vector<Event>& events, std::vector<double>* chances);

 private:
  double added_variance(std::size_t sensor) const;
  double failed_in(const AfterStep<Most>& after) const {
    return (1 - supposed_.outliers) * after.failed + supposed_.outliers * after.failed_wide;
  }
  // A row that says nothing may be a failure, too.
  double tolerated(double chance) const { return supposed_.wild + (1 - supposed_.wild) * chance; }
  Part launched(const MachineRow& row) const;
  Part begun_elsewhere(const MachineRow& row) const;
  std::map<std::size_t, AfterStep<Most>> stepped_elsewhere(BeliefStep<Most>& stepping) const;
  Part begun(const MachineRow& row);
  Look<Most> look(std::size_t sensor, Eigen::Index size) const;
  Part see(AfterStep<Most>& after, const MachineRow& row);
  void put(std::size_t event, const SeenValue& seen, double failed);

  const Machine& machine_;
  const MachineRuns& runs_;
  const ScorePlan& plan_;
  const MachineHypothesis& supposed_;
  MachineStepper stepper_;
  std::vector<Eigen::Index> state_;  // by sensor
  std::vector<int> shared_;          // by sensor: which of those that share errors; -1: none
  int shared_count_ = 0;
  int bent_ = 0;                              // numbers of the vector in which beliefs are bent
  std::vector<double> scale_;                 // by sensor: spread of its column
  std::vector<const MachineLaunch*> stated_;  // by sensor: the launch that is stated of its state; nullptr: none
  std::vector<NormalLaunch> first_rows_;      // by sensor: how values of first rows scatter
  std::vector<std::size_t> first_;            // by trial: number of its first transition
  Evaluation out_;
  std::vector<double>* chances_ = nullptr;
  std::vector<std::size_t> cursor_;  // by trial: its next event
  std::size_t trial_ = 0;
};

// Returns the variance of the error that no other row shares, with what keeps a density finite.
template <int Most>
double Follower<Most>::added_variance(std::size_t sensor) const {
  const double floor = least_share * scale_[sensor];
  double variance = floor * floor;
  if (!supposed_.added_noise.empty()) variance += supposed_.added_noise[sensor] * supposed_.added_noise[sensor];
  if (shared_[sensor] < 0) variance += supposed_.sensor_sd[sensor] * supposed_.sensor_sd[sensor];
  return variance;
}

// The belief at a row before which nothing is known: what was seen of it, else the launch.
template <int Most>
typename BeliefMixture<Most>::Part Follower<Most>::launched(const MachineRow& row) const {
  const auto size = static_cast<Eigen::Index>(stepper_.size());
  Part belief{0, BeliefVector<Most>::Zero(size + shared_count_),
              BeliefMatrix<Most>::Zero(size + shared_count_, size + shared_count_), 1};
  const auto states = static_cast<Eigen::Index>(stepper_.states());
  for (const MachineLaunch& launch : machine_.launches) {
    const auto s = static_cast<Eigen::Index>(machine_.state_index(launch.state));
    const NormalLaunch at = supposed_launch(supposed_, launch, static_cast<std::size_t>(s));
    belief.mean[s] = at.mean;
    belief.covariance(s, s) = at.sd * at.sd;
  }
  Eigen::Index offset = states;
  for (const double sd : supposed_.offset_sds()) {
    belief.covariance(offset, offset) = sd * sd;
    ++offset;
  }
  for (Eigen::Index m = offset; m < size; ++m) belief.covariance(m, m) = 1;
  for (std::size_t j = 0; j < state_.size(); ++j) {
    const Eigen::Index s = state_[j];
    if (shared_[j] >= 0) belief.covariance(size + shared_[j], size + shared_[j]) = 1;
    if (std::isnan(row.seen[j])) continue;
    belief.mean[s] = row.seen[j] - (supposed_.bias.empty() ? 0 : supposed_.bias[j]);
    belief.covariance(s, s) = added_variance(j);
    if (shared_[j] < 0) continue;
    const auto [own, kept] = machine_.observe[j].shared_error();
    const double sd = supposed_.sensor_sd[j];
    belief.covariance(s, s) += sd * sd * (own * own + kept * kept);
    belief.covariance(s, size + shared_[j]) = belief.covariance(size + shared_[j], s) = -sd * own;
  }
  return belief;
}

// The belief at a trial's first row. A state whose launch is stated comes from there, and its value in the row is an
// event: it is held against the launch and sharpens what is believed of the state.
template <int Most>
typename BeliefMixture<Most>::Part Follower<Most>::begun(const MachineRow& row) {
  Part belief = launched(row);
  const Eigen::Index kept = belief.mean.size(), size = kept + shared_count_;
  std::vector<std::size_t> compared;
  for (std::size_t j = 0; j < state_.size(); ++j)
    if (stated_[j] && !std::isnan(row.seen[j])) compared.push_back(j);
  if (compared.empty()) return belief;
  belief.mean.conservativeResize(size);
  belief.covariance.conservativeResize(size, size);
  belief.mean.tail(shared_count_).setZero();
  belief.covariance.rightCols(shared_count_).setZero();
  belief.covariance.bottomRows(shared_count_).setZero();
  for (Eigen::Index i = kept; i < size; ++i) belief.covariance(i, i) = 1;  // errors of the rows before
  for (const std::size_t j : compared) {
    const Eigen::Index s = state_[j];
    const NormalLaunch at = supposed_launch(supposed_, *stated_[j], static_cast<std::size_t>(s));
    belief.mean[s] = at.mean;
    belief.covariance.row(s).setZero();
    belief.covariance.col(s).setZero();
    belief.covariance(s, s) = at.sd * at.sd;
  }
  BeliefMixture<Most> mixture;
  mixture.parts().push_back(std::move(belief));
  mixture.add_wild(supposed_.wild, wild_widths);
  for (const std::size_t j : compared) put(cursor_[trial_]++, mixture.see(look(j, size), row.seen[j], 0), 0);
  belief = mixture.collapsed();
  belief.mean.conservativeResize(kept);
  belief.covariance.conservativeResize(kept, kept);
  return belief;
}

// The belief at a trial's first row where that row is wild: the trial begins as others do.
template <int Most>
typename BeliefMixture<Most>::Part Follower<Most>::begun_elsewhere(const MachineRow& row) const {
  MachineRow nothing = row;
  std::ranges::fill(nothing.seen, std::numeric_limits<double>::quiet_NaN());
  Part belief = launched(nothing);
  for (std::size_t j = 0; j < state_.size(); ++j) {
    if (stated_[j]) continue;
    belief.mean[state_[j]] = first_rows_[j].mean - (supposed_.bias.empty() ? 0 : supposed_.bias[j]);
    belief.covariance(state_[j], state_[j]) = first_rows_[j].sd * first_rows_[j].sd + added_variance(j);
  }
  return belief;
}

// Steps trials from first rows that are wild, by trial. A wild first row is no event, but a trial that was believed to
// begin where it shows would look like one with a wide noise.
template <int Most>
std::map<std::size_t, AfterStep<Most>> Follower<Most>::stepped_elsewhere(BeliefStep<Most>& stepping) const {
  std::vector<TransitionPlace> places;
  std::vector<Part> beliefs;
  for (std::size_t t = 0; t < runs_.trials.size() && supposed_.wild > 0; ++t) {
    const std::vector<MachineRow>& rows = runs_.trials[t].rows;
    if (steps_of(runs_.trials[t]) == 0 || (rows.size() < 2 && !plan_.failing)) continue;
    bool shows = false;
    for (std::size_t j = 0; j < state_.size(); ++j) shows |= !stated_[j] && !std::isnan(rows.front().seen[j]);
    if (!shows) continue;
    places.push_back({t, 0, first_[t]});
    beliefs.push_back(begun_elsewhere(rows.front()));
  }
  std::map<std::size_t, AfterStep<Most>> by_trial;
  if (!places.empty())
    stepping.step(places, beliefs, [&](std::size_t i, AfterStep<Most>& after) {
      AfterStep<Most>& kept = by_trial[places[i].trial];
      kept.failed = after.failed;
      kept.failed_wide = after.failed_wide;
      if (after.belief.parts().empty()) return;
      kept.belief.parts().push_back(after.belief.collapsed());  // It is one wide normal, as it was before the step.
      kept.belief.parts().front().log_weight = std::log1p(-std::min(failed_in(after), surely));
    });
  return by_trial;
}

template <int Most>
Look<Most> Follower<Most>::look(std::size_t sensor, Eigen::Index size) const {
  Look<Most> look{BeliefVector<Most>::Zero(size), supposed_.bias.empty() ? 0 : supposed_.bias[sensor],
                  added_variance(sensor)};
  look.weights[state_[sensor]] = 1;
  if (shared_[sensor] < 0) return look;
  const auto [own, kept] = machine_.observe[sensor].shared_error();
  const auto at = static_cast<Eigen::Index>(stepper_.size()) + shared_[sensor];
  look.weights[at] = supposed_.sensor_sd[sensor] * own;
  look.weights[at + shared_count_] = supposed_.sensor_sd[sensor] * kept;
  return look;
}

template <int Most>
void Follower<Most>::put(std::size_t event, const SeenValue& seen, double failed) {
  out_.log_density[event] = seen.log_density;
  out_.score[event] = seen.score;
  out_.unit[event] = seen.unit;
  if (chances_) (*chances_)[event] = failed;
}

// Sharpens the belief by a row and forgets the errors of the row before.
template <int Most>
typename BeliefMixture<Most>::Part Follower<Most>::see(AfterStep<Most>& after, const MachineRow& row) {
  const Eigen::Index kept = static_cast<Eigen::Index>(stepper_.size()) + shared_count_;
  double failed = plan_.failing ? tolerated(failed_in(after)) : 0;
  std::size_t& event = cursor_[trial_];
  if (after.belief.parts().empty()) {  // it is sure to have failed, and did not
    for (const double x : row.seen)
      if (!std::isnan(x)) put(event++, out_of_reach, failed);
    if (unseen(row) && plan_.failing) put(event++, out_of_reach, failed);
    return launched(row);
  }
  if (unseen(row)) {
    if (plan_.failing) put(event++, {std::log(std::max(least_chance, 1 - failed)), 0, 1}, failed);
  } else {
    after.belief.add_wild(supposed_.wild, wild_widths);
    std::vector<Look<Most>> looks;
    std::vector<double> values;
    for (std::size_t j = 0; j < state_.size(); ++j) {
      if (std::isnan(row.seen[j])) continue;
      looks.push_back(look(j, kept + shared_count_ + bent_));
      values.push_back(row.seen[j]);
    }
    if (bent_ > 0) after.belief.straighten(looks, values);
    for (std::size_t i = 0; i < looks.size(); ++i) {
      put(event++, after.belief.see(looks[i], values[i], failed), failed > 0 ? failed_in(after) : 0);
      failed = 0;
    }
  }
  Part belief = after.belief.collapsed();
  belief.mean.conservativeResize(kept);
  belief.covariance.conservativeResize(kept, kept);
  return belief;
}

template <int Most>
Evaluation Follower<Most>::follow(const std::vector<Event>& events, std::vector<double>* chances) {
  out_.log_density.assign(events.size(), 0.0);
  out_.score = out_.unit = out_.log_density;
  chances_ = chances;
  if (chances) chances->assign(events.size(), 0.0);
  cursor_.assign(runs_.trials.size(), events.size());
  for (std::size_t e = events.size(); e-- > 0;) cursor_[events[e].trial] = e;
  std::vector<Part> beliefs;
  for (trial_ = 0; trial_ < runs_.trials.size(); ++trial_)
    beliefs.push_back(steps_of(runs_.trials[trial_]) == 0 ? Part{} : begun(runs_.trials[trial_].rows.front()));
  BeliefStep<Most> stepping(stepper_, plan_, static_cast<std::size_t>(shared_count_), bent_ > 0, supposed_.outliers);
  for (std::size_t k = 0; k < runs_.longest(); ++k) {
    std::vector<TransitionPlace> places;
    std::vector<Part> before;
    for (std::size_t t = 0; t < runs_.trials.size(); ++t)
      if (steps_of(runs_.trials[t]) > k && (k + 1 < runs_.trials[t].rows.size() || plan_.failing)) {
        places.push_back({t, k, first_[t] + k});
        before.push_back(beliefs[t]);
      }
    if (places.empty()) break;
    std::map<std::size_t, AfterStep<Most>> elsewhere;
    if (k == 0) {
      stepping.seek(places, before);
      elsewhere = stepped_elsewhere(stepping);
    }
    stepping.step(places, before, [&](std::size_t i, AfterStep<Most>& after) {
      trial_ = places[i].trial;
      if (const auto other = elsewhere.find(trial_); other != elsewhere.end())
        take_beside(after, std::move(other->second), supposed_.wild);
      const MachineTrial& trial = runs_.trials[trial_];
      if (k + 1 < trial.rows.size()) {
        beliefs[trial_] = see(after, trial.rows[k + 1]);
      } else {
        const double chance = std::clamp(tolerated(failed_in(after)), least_chance, 1.0);
        const double score = dynamics::normal_quantile(std::clamp(0.5 * chance, least_chance, 0.5));
        put(cursor_[trial_]++, {std::log(chance), score, 1}, failed_in(after));
      }
    });
  }
  return std::move(out_);
}

}  // namespace

std::vector<Event> machine_events(const Machine& machine, const MachineRuns& runs, const ScorePlan& plan) {
  std::vector<Event> all;
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    const MachineTrial& trial = runs.trials[t];
    for (std::size_t j = 0; j < machine.observe.size() && steps_of(trial) > 0; ++j)
      if (machine.stated_launch(machine.observe[j].state) && !std::isnan(trial.rows.front().seen[j]))
        all.push_back({.kind = EventKind::launch, .trial = t, .condition = trial.condition, .column = j});
    for (std::size_t k = 0; k < steps_of(trial); ++k) {
      const MachineRow& row = trial.rows[k];
      Event event;
      event.trial = t;
      event.condition = trial.condition;
      event.number = static_cast<int>(k) + 1;
      if (row.phase >= 0) event.leg = row.phase;
      if (std::isfinite(row.position)) event.position = row.position;
      if (k > 0 && std::isfinite(row.time) && std::isfinite(trial.rows[k - 1].time))
        event.since_previous = row.time - trial.rows[k - 1].time;
      event.speed = row.seen[0];
      const bool last = k + 1 == trial.rows.size();
      if (last || unseen(trial.rows[k + 1])) {
        event.kind = last ? EventKind::rest : EventKind::survival;
        if (plan.failing) {
          event.rested = last;
          all.push_back(event);
        }
        continue;
      }
      bool first = true;
      for (std::size_t j = 0; j < machine.observe.size(); ++j) {
        if (std::isnan(trial.rows[k + 1].seen[j])) continue;
        event.column = j;
        event.speed = row.seen[j];
        event.rested = first && plan.failing ? std::optional(false) : std::nullopt;
        all.push_back(event);
        first = false;
      }
    }
  }
  return all;
}

Evaluation follow_machine(const Machine& machine, const MachineRuns& runs, const ScorePlan& plan,
                          const std::vector<Event>& events, const MachineHypothesis& supposed,
                          std::vector<double>* chances) {
  std::size_t size = machine.states.size() + supposed.offset_sds().size() + static_cast<std::size_t>(machine.scores);
  if (!supposed.memory.empty()) size += static_cast<std::size_t>(machine.scores);
  for (const MachineSensor& sensor : machine.observe) size += sensor.correlation != 0 ? 2 : 0;
  size += static_cast<std::size_t>(bent_numbers(machine, plan));
  if (size <= small_belief) return Follower<small_belief>(machine, runs, plan, supposed).follow(events, chances);
  return Follower<Eigen::Dynamic>(machine, runs, plan, supposed).follow(events, chances);
}

}  // namespace metastable::analysis
