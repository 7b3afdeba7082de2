#include "analysis/machine_model/machine_simulation.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_stepper.h"
#include "analysis/statistics/random.h"
#include "analysis/statistics/smooth_sample.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double enough_steps = 30000, enough_failures = 300;
constexpr double most_experiments = 64;  // whose trials are walked at once
constexpr std::uint64_t seeds_apart = 0x9E3779B97F4A7C15;

// Draws numbers of one trial by row and purpose.
class Draws {
 public:
  Draws(std::uint64_t seed, std::size_t trial) : seed_(seed), trial_(trial) {}
  double uniform(std::size_t row, std::size_t purpose) const {
    return uniform_at(seed_, trial_, row * most_purposes + purpose, static_cast<std::uint64_t>(DrawStream::machine));
  }
  double normal(std::size_t row, std::size_t purpose) const { return dynamics::normal_quantile(uniform(row, purpose)); }

 private:
  static constexpr std::size_t most_purposes = 256;
  std::uint64_t seed_;
  std::size_t trial_;
};

// The purpose of a random number. Scores, sensors and offsets count up from the number of theirs.
enum Purpose : std::size_t {
  outlier,
  wild,
  scores,
  errors = 32,
  added = 64,
  offsets = 96,
  earlier = 128,
  wild_error = 160,
  launch = 192,
  donor = 224,
  kernel = 225,
  wild_size = 226
};

double wild_width(const Draws& draws, std::size_t row) {
  return wild_widths[draws.uniform(row, wild_size) < 0.5 ? 0 : 1];
}

// A trial under way.
struct Walking {
  Eigen::VectorXd point;       // as MachineStepper's
  Eigen::VectorXd errors;      // by sensor: of this row
  std::vector<double> hidden;  // states that the map lacks
  bool over = false;
};

// The trials of all experiments, one experiment after the other.
MachineRuns all_trials(std::span<const MachineRuns> experiments) {
  MachineRuns all = experiments.front();
  for (const MachineRuns& one : experiments.subspan(1))
    all.trials.insert(all.trials.end(), one.trials.begin(), one.trials.end());
  return all;
}

MachineHypothesis without_hidden(MachineHypothesis h) {
  h.hidden.clear();
  return h;
}

// Walks the trials of experiments that differ in their launches, all together.
class Walker {
 public:
  Walker(const Machine& machine, std::span<const MachineRuns> experiments, const MachineHypothesis& supposed,
         std::span<const std::uint64_t> seeds, Launches launches)
      : machine_(machine),
        runs_(all_trials(experiments)),
        supposed_(supposed),
        seeds_(seeds),
        launches_(launches),
        each_(experiments.front().trials.size()),
        seen_alone_(without_hidden(supposed)),
        stepper_(machine, runs_, seen_alone_) {
    for (const MachineRuns& one : experiments) designs_.push_back(machine_design(machine, one));
  }
  std::vector<MachineRuns> walk();

 private:
  std::size_t planned(std::size_t trial) const;
  std::size_t design_row(std::size_t trial, std::size_t row) const;
  Walking launched(std::size_t trial, MachineRow& first) const;
  bool drawn_launch(std::size_t sensor, const MachineRow& row) const;
  double error(std::size_t sensor, double now, double before) const;
  MachineRow seen(std::size_t trial, std::size_t row, Walking& walking) const;
  void carry(Walking& walking, const Eigen::Ref<const Eigen::VectorXd>& next) const;
  std::vector<MachineRuns> apart(MachineRuns all) const;
  Draws draws_of(std::size_t trial) const { return {seeds_[trial / each_], trial % each_}; }

  const Machine& machine_;
  MachineRuns runs_;
  const MachineHypothesis& supposed_;
  std::span<const std::uint64_t> seeds_;  // by experiment
  Launches launches_;
  std::size_t each_;              // trials of an experiment
  MachineHypothesis seen_alone_;  // what is supposed but for hidden states, which are carried along
  MachineStepper stepper_;
  std::vector<MachineDesign> designs_;  // by experiment
};

std::size_t Walker::planned(std::size_t trial) const {
  return runs_.trials[trial].outcome == MachineOutcome::failed ? runs_.longest() : runs_.trials[trial].rows.size();
}

// Rows beyond those that were measured are as the last ones were, phase by phase: this is the row that one is like.
std::size_t Walker::design_row(std::size_t trial, std::size_t row) const {
  const std::size_t rows = runs_.trials[trial].rows.size(), period = std::max<std::size_t>(1, runs_.phases.size());
  if (row < rows) return row;
  return rows < period ? rows - 1 : row - period * ((row - rows) / period + 1);
}

double Walker::error(std::size_t sensor, double now, double before) const {
  const auto [own, kept] = machine_.observe[sensor].shared_error();
  return supposed_.sensor_sd[sensor] * (own * now + kept * before);
}

// Says whether the value of a first row is drawn from the launch that is stated.
bool Walker::drawn_launch(std::size_t sensor, const MachineRow& row) const {
  return launches_ == Launches::stated && !std::isnan(row.seen[sensor]) &&
         machine_.stated_launch(machine_.observe[sensor].state);
}

// @param first  the measured row of the trial's first state, where values that are drawn are put
Walking Walker::launched(std::size_t trial, MachineRow& first) const {
  const Draws draws = draws_of(trial);
  const MachineRow& row = runs_.trials[trial].rows.front();
  const bool is_wild = draws.uniform(0, wild) < supposed_.wild;
  Walking walking{Eigen::VectorXd::Zero(static_cast<Eigen::Index>(stepper_.size())),
                  Eigen::VectorXd::Zero(static_cast<Eigen::Index>(machine_.observe.size())),
                  {},
                  false};
  for (std::size_t l = 0; l < machine_.launches.size(); ++l) {
    const std::size_t s = machine_.state_index(machine_.launches[l].state);
    const NormalLaunch at = supposed_launch(supposed_, machine_.launches[l], s);
    walking.point[static_cast<Eigen::Index>(s)] =
        at.mean + (machine_.launches[l].assumed ? 0 : at.sd * draws.normal(0, launch + l));
  }
  for (std::size_t j = 0; j < machine_.observe.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    const std::size_t s = machine_.state_index(machine_.observe[j].state);
    walking.errors[at] = draws.normal(0, errors + j);
    if (std::isnan(row.seen[j])) continue;
    double off = error(j, walking.errors[at], draws.normal(0, earlier + j));
    if (!supposed_.added_noise.empty()) off += supposed_.added_noise[j] * draws.normal(0, added + j);
    double& point = walking.point[static_cast<Eigen::Index>(s)];
    if (drawn_launch(j, row)) {
      const NormalLaunch from = supposed_launch(supposed_, *machine_.stated_launch(machine_.observe[j].state), s);
      if (is_wild)
        off = wild_width(draws, 0) * std::hypot(from.sd, supposed_.sensor_sd[j]) * draws.normal(0, wild_error + j);
      if (!supposed_.bias.empty()) off += supposed_.bias[j];
      first.seen[j] = point + off;
      continue;
    }
    if (!supposed_.bias.empty()) off += supposed_.bias[j];
    point = row.seen[j] - off;
  }
  Eigen::Index at = static_cast<Eigen::Index>(stepper_.states());
  const std::vector<double> sds = supposed_.offset_sds();
  for (std::size_t i = 0; i < sds.size(); ++i, ++at) walking.point[at] = sds[i] * draws.normal(0, offsets + i);
  for (std::size_t m = 0; at < walking.point.size(); ++at, ++m) walking.point[at] = draws.normal(0, scores + m);
  return walking;
}

// The measured row: the state with its errors, and with the values missing that the design lacks.
MachineRow Walker::seen(std::size_t trial, std::size_t row, Walking& walking) const {
  const Draws draws = draws_of(trial);
  const MachineDesign& design = designs_[trial / each_];
  const std::size_t like = design_row(trial, row);
  MachineRow out = runs_.trials[trial].rows[like];
  out.time += static_cast<double>(row - like) * design.usual_gap;
  const bool is_wild = draws.uniform(row, wild) < supposed_.wild;
  for (std::size_t j = 0; j < machine_.observe.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(j);
    const double before = walking.errors[at];
    walking.errors[at] = draws.normal(row, errors + j);
    if (std::isnan(out.seen[j])) continue;
    double off = error(j, walking.errors[at], before);
    if (!supposed_.added_noise.empty()) off += supposed_.added_noise[j] * draws.normal(row, added + j);
    if (is_wild)
      off = wild_width(draws, row) * std::hypot(design.change[j], supposed_.sensor_sd[j]) *
            draws.normal(row, wild_error + j);
    if (!supposed_.bias.empty()) off += supposed_.bias[j];
    out.seen[j] = walking.point[static_cast<Eigen::Index>(machine_.state_index(machine_.observe[j].state))] + off;
  }
  return out;
}

// Takes a trial to its next state, and the states that the map lacks to theirs.
void Walker::carry(Walking& walking, const Eigen::Ref<const Eigen::VectorXd>& next) const {
  const Eigen::VectorXd from = walking.point;
  walking.point.head(next.size()) = next;
  for (std::size_t i = 0; i < supposed_.hidden.size(); ++i) {
    const MachineHypothesis::Hidden& one = supposed_.hidden[i];
    const double ahead = walking.hidden[i] - from[static_cast<Eigen::Index>(one.follows)];
    walking.point[static_cast<Eigen::Index>(one.pushes)] += one.pull * ahead;
    walking.hidden[i] -= (1 - one.kept) * ahead;
  }
}

std::vector<MachineRuns> Walker::walk() {
  MachineRuns out = runs_;
  std::vector<Walking> walking;
  std::vector<std::size_t> first;
  std::size_t number = 0;
  for (std::size_t t = 0; t < runs_.trials.size(); ++t) {
    if (t % each_ == 0) number = 0;
    first.push_back(number);
    number += steps_of(runs_.trials[t]);
    if (runs_.trials[t].rows.empty()) {
      walking.push_back({{}, {}, {}, true});
      continue;
    }
    walking.push_back(launched(t, out.trials[t].rows.front()));
    for (const MachineHypothesis::Hidden& one : supposed_.hidden)
      walking.back().hidden.push_back(walking.back().point[static_cast<Eigen::Index>(one.follows)] +
                                      (first[t] < one.ahead.size() ? one.ahead[first[t]] : 0));
    out.trials[t].rows.resize(1);
    if (out.trials[t].outcome == MachineOutcome::failed) out.trials[t].outcome = MachineOutcome::stopped;
  }
  for (std::size_t k = 0; k + 1 < std::max<std::size_t>(2, runs_.longest()); ++k) {
    stepper_.clear();
    std::vector<std::size_t> who;
    for (std::size_t t = 0; t < walking.size(); ++t) {
      if (walking[t].over || k + 1 >= planned(t)) continue;
      const Draws draws = draws_of(t);
      Eigen::VectorXd fresh(static_cast<Eigen::Index>(stepper_.scores()));
      const double width = draws.uniform(k + 1, outlier) < supposed_.outliers ? outlier_width : 1;
      for (std::size_t m = 0; m < stepper_.scores(); ++m)
        fresh[static_cast<Eigen::Index>(m)] = width * draws.normal(k + 1, scores + m);
      const std::size_t like = design_row(t, k);
      stepper_.add({t, like, first[t] + like}, walking[t].point, fresh);
      for (std::size_t m = 0; stepper_.remembers() && m < stepper_.scores(); ++m) {
        double& before = walking[t].point[static_cast<Eigen::Index>(stepper_.states() + stepper_.offsets() + m)];
        const double kept = stepper_.memory(m);
        before = kept * before + std::sqrt(1 - kept * kept) * fresh[static_cast<Eigen::Index>(m)];
      }
      who.push_back(t);
    }
    if (who.empty()) break;
    stepper_.run();
    for (std::size_t i = 0; i < who.size(); ++i) {
      Walking& one = walking[who[i]];
      if (stepper_.failed(i)) {
        one.over = true;
        out.trials[who[i]].outcome = MachineOutcome::failed;
        continue;
      }
      carry(one, stepper_.next(i));
      out.trials[who[i]].rows.push_back(seen(who[i], k + 1, one));
    }
  }
  return apart(std::move(out));
}

std::vector<MachineRuns> Walker::apart(MachineRuns all) const {
  std::vector<MachineTrial> trials;
  trials.swap(all.trials);
  std::vector<MachineRuns> experiments(seeds_.size(), all);
  for (std::size_t t = 0; t < trials.size(); ++t) experiments[t / each_].trials.push_back(std::move(trials[t]));
  return experiments;
}

// Trials of one design: their first rows hold the same columns, at least one.
struct AlikeLaunches {
  std::vector<std::size_t> trials;
  std::vector<int> group;         // by trial: of those with the same condition, phase and labels
  std::vector<std::size_t> seen;  // sensors
  Eigen::MatrixXd points;         // [trials x seen]
};

void launch_at(MachineTrial& trial, const std::vector<std::size_t>& seen, const Eigen::VectorXd& values) {
  for (std::size_t c = 0; c < seen.size(); ++c) trial.rows.front().seen[seen[c]] = values[static_cast<Eigen::Index>(c)];
}

std::vector<AlikeLaunches> alike_launches(const MachineRuns& runs) {
  std::map<std::vector<bool>, AlikeLaunches> by_columns;
  std::map<std::vector<bool>, std::map<std::tuple<std::size_t, int, std::vector<int>>, int>> groups;
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    const MachineTrial& trial = runs.trials[t];
    if (trial.rows.empty()) continue;
    const MachineRow& row = trial.rows.front();
    std::vector<bool> columns;
    for (const double seen : row.seen) columns.push_back(!std::isnan(seen));
    auto& known = groups[columns];
    const auto number = static_cast<int>(known.size());
    by_columns[columns].trials.push_back(t);
    by_columns[columns].group.push_back(
        known.try_emplace({trial.condition, row.phase, row.labels}, number).first->second);
  }
  std::vector<AlikeLaunches> all;
  for (auto& [columns, alike] : by_columns) {
    for (std::size_t j = 0; j < columns.size(); ++j)
      if (columns[j]) alike.seen.push_back(j);
    if (alike.seen.empty()) continue;
    alike.points.resize(static_cast<Eigen::Index>(alike.trials.size()), static_cast<Eigen::Index>(alike.seen.size()));
    for (std::size_t i = 0; i < alike.trials.size(); ++i)
      for (std::size_t c = 0; c < alike.seen.size(); ++c)
        alike.points(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) =
            runs.trials[alike.trials[i]].rows.front().seen[alike.seen[c]];
    all.push_back(std::move(alike));
  }
  return all;
}

}  // namespace

MachineRuns smoothed_launches(const MachineRuns& runs, const MachineHypothesis& supposed, std::uint64_t seed) {
  MachineRuns out = runs;
  for (const AlikeLaunches& alike : alike_launches(runs)) {
    const auto size = static_cast<Eigen::Index>(alike.seen.size());
    Eigen::VectorXd errors(size), normals(size);
    for (Eigen::Index c = 0; c < size; ++c) {
      const std::size_t j = alike.seen[static_cast<std::size_t>(c)];
      const double added = supposed.added_noise.empty() ? 0 : supposed.added_noise[j];
      // The values hold one error, and a simulation takes off another.
      errors[c] = 2 * (supposed.sensor_sd[j] * supposed.sensor_sd[j] + added * added);
    }
    const SmoothSample sample(alike.points, alike.group, errors);
    for (std::size_t i = 0; i < alike.trials.size(); ++i) {
      const Draws draws(seed, alike.trials[i]);
      for (Eigen::Index c = 0; c < size; ++c) normals[c] = draws.normal(0, kernel + static_cast<std::size_t>(c));
      launch_at(out.trials[alike.trials[i]], alike.seen, sample.draw(i, draws.uniform(0, donor), normals));
    }
  }
  return out;
}

MachineRuns redrawn_launches(const MachineRuns& runs, std::uint64_t seed) {
  MachineRuns out = runs;
  for (const AlikeLaunches& alike : alike_launches(runs)) {
    std::vector<double> uniforms;
    for (const std::size_t t : alike.trials) uniforms.push_back(Draws(seed, t).uniform(0, donor));
    const Eigen::MatrixXd drawn = reflected_bootstrap(alike.points, alike.group, uniforms);
    for (std::size_t i = 0; i < alike.trials.size(); ++i)
      launch_at(out.trials[alike.trials[i]], alike.seen, drawn.row(static_cast<Eigen::Index>(i)));
  }
  return out;
}

MachineRuns simulate_machine(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                             std::uint64_t seed, Launches launches) {
  return std::move(simulate_machines(machine, {&runs, 1}, supposed, {&seed, 1}, launches).front());
}

std::vector<MachineRuns> simulate_machines(const Machine& machine, std::span<const MachineRuns> experiments,
                                           const MachineHypothesis& supposed, std::span<const std::uint64_t> seeds,
                                           Launches launches) {
  return Walker(machine, experiments, supposed, seeds, launches).walk();
}

CountedSteps counted_failures(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed,
                              std::uint64_t seed) {
  CountedSteps counted;
  std::uint64_t drawn_so_far = 0;
  const auto enough = [&] { return counted.steps >= enough_steps || counted.failed >= enough_failures; };
  while (!enough()) {
    // The first experiment tells how many there will be. Those are walked together, so that the map is called less
    // often.
    const double share = std::max(counted.steps / enough_steps, counted.failed / enough_failures);
    const auto so_far = static_cast<double>(drawn_so_far);
    const double more = drawn_so_far == 0 ? 1 : std::clamp(std::ceil(so_far / share) - so_far, 1.0, most_experiments);
    std::vector<MachineRuns> launched;
    std::vector<std::uint64_t> seeds;
    for (std::size_t i = 0; i < static_cast<std::size_t>(more); ++i, ++drawn_so_far) {
      seeds.push_back(seed + drawn_so_far * seeds_apart);
      launched.push_back(smoothed_launches(runs, supposed, seeds.back()));
    }
    for (const MachineRuns& drawn : simulate_machines(machine, launched, supposed, seeds)) {
      if (enough()) break;
      for (const MachineTrial& trial : drawn.trials) {
        counted.steps += static_cast<double>(steps_of(trial));
        counted.failed += trial.outcome == MachineOutcome::failed;
      }
    }
  }
  return counted;
}

}  // namespace metastable::analysis
