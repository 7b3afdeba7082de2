#include "analysis/machine_model/machine_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/machine_model/machine_design.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

// A column whose values are this many times what the map makes of them is in another unit; the factor is met within a
// share.
struct UnitFactor {
  double factor;
  const char* words;       // of what is compared with the machine
  const char* words_here;  // of trials that are compared with the others
};
constexpr UnitFactor unit_factors[]{
    {180 / std::numbers::pi, "degrees where the machine has radians", "degrees where the others are in radians"},
    {std::numbers::pi / 180, "radians where the machine has degrees", "radians where the others are in degrees"},
    {1000, "thousandths of the machine's unit", "thousandths of the others' unit"},
    {0.001, "thousands of the machine's unit", "thousands of the others' unit"}};
constexpr double values_apart = 0.15, scatters_apart = 0.5;  // of logarithms; scatter is known roughly
constexpr double same_share = 1e-6;                          // of the largest value of a state, asked for twice
constexpr std::size_t most_asked = 256;                      // At most so many rows are asked about anew.
constexpr double move_share = 0.05;  // A parameter is moved by this share of its value, an effect of its range.
// Solvers share their steps among rows. What each state differs by, summed over rows, may hence be the first share of
// what the moved parameters change, and the second one of the state's largest value.
constexpr double mixed_share = 0.1, solver_share = 1e-4;
constexpr double trials_apart = 0.5;                         // of logarithms, of trials that start anywhere
constexpr double trials_alike = 0.4;                         // of that factor's logarithm: spread of trials in one unit
constexpr double launch_off = 4;                             // standard errors: one machine in 16000 by chance
constexpr std::size_t fewest_for_units = 10;                 // rows
constexpr std::size_t fewest_compared = 4, fewest_rows = 3;  // for trials to be compared; of a trial that stands still

template <class Known>
bool every_row(const MachineRuns& runs, Known known) {
  return !runs.trials.empty() && std::ranges::all_of(runs.trials, [&](const MachineTrial& trial) {
    return std::ranges::all_of(trial.rows, known);
  });
}

void require_shape(const Machine& machine, const MachineRuns& runs) {
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (const MachineRow& row : runs.trials[t].rows) {
      if (row.seen.size() != machine.observe.size() || row.inputs.size() != machine.inputs.size())
        throw std::invalid_argument(fmt::format("trial {}: a row has {} states and {} inputs where {} and {} belong",
                                                runs.name_of(t), row.seen.size(), row.inputs.size(),
                                                machine.observe.size(), machine.inputs.size()));
      if (std::ranges::any_of(row.seen, [](double x) { return std::isinf(x); }))
        throw std::invalid_argument(fmt::format("trial {}: a state is infinite", runs.name_of(t)));
      const bool steps = &row != &runs.trials[t].rows.back() || runs.trials[t].outcome == MachineOutcome::failed;
      if (steps && !std::ranges::all_of(row.inputs, [](double x) { return std::isfinite(x); }))
        throw std::invalid_argument(fmt::format("trial {}: an input is not a finite number", runs.name_of(t)));
    }
}

// Rows whose time is not known are passed over.
void require_clock(const MachineRuns& runs) {
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    double latest = -std::numeric_limits<double>::infinity();
    for (const MachineRow& row : runs.trials[t].rows) {
      if (row.time < latest)
        throw std::invalid_argument(fmt::format("time_s: it runs back in trial {}, row {}: {} comes after {}",
                                                runs.name_of(t), &row - runs.trials[t].rows.data() + 1, row.time,
                                                latest));
      if (!std::isnan(row.time)) latest = row.time;
    }
  }
}

// A column that says which machine a trial is of settles it: one set of parameters cannot be two machines'.
void require_one_machine(const MachineRuns& runs) {
  for (std::size_t l = 0; l < runs.labels.size(); ++l) {
    if (runs.labels[l].name != "machine") continue;
    std::optional<std::pair<int, std::size_t>> first;  // its value, and the trial that has it
    for (std::size_t t = 0; t < runs.trials.size(); ++t)
      for (const MachineRow& row : runs.trials[t].rows) {
        if (row.labels.size() <= l || row.labels[l] < 0) continue;
        if (!first) first = {row.labels[l], t};
        if (row.labels[l] != first->first)
          throw std::invalid_argument(
              fmt::format("machine: trial {} is of {} and trial {} of {}: give each machine runs of its own",
                          runs.name_of(first->second), runs.labels[l].values[static_cast<std::size_t>(first->first)],
                          runs.name_of(t), runs.labels[l].values[static_cast<std::size_t>(row.labels[l])]));
      }
  }
}

void require_launch(const Machine& machine, const MachineRuns& runs) {
  for (std::size_t s = 0; s < machine.states.size(); ++s) {
    const std::string& state = machine.states[s];
    if (std::ranges::find(machine.launches, state, &MachineLaunch::state) != machine.launches.end()) continue;
    const auto sensor = std::ranges::find(machine.observe, state, &MachineSensor::state);
    if (sensor == machine.observe.end())
      throw std::invalid_argument(
          fmt::format("launch: {} is not measured: its first value has to be given with its sd", state));
    const auto j = static_cast<std::size_t>(sensor - machine.observe.begin());
    for (std::size_t t = 0; t < runs.trials.size(); ++t)
      if (steps_of(runs.trials[t]) > 0 && std::isnan(runs.trials[t].rows.front().seen[j]))
        throw std::invalid_argument(fmt::format(
            "launch: trial {} begins without {}: its first value has to be given with its sd", runs.name_of(t), state));
  }
}

std::vector<double> column(const MachineRuns& runs, std::size_t sensor) {
  std::vector<double> values;
  for (const MachineTrial& trial : runs.trials)
    for (const MachineRow& row : trial.rows)
      if (!std::isnan(row.seen[sensor])) values.push_back(row.seen[sensor]);
  return values;
}

// Names some trials: how many, of how many, and one of them.
std::string named_trials(const MachineRuns& runs, const std::vector<std::size_t>& some) {
  if (some.size() == 1) return "trial " + runs.name_of(some.front());
  return fmt::format("{} of {} trials (trial {} for one)", some.size(), runs.trials.size(), runs.name_of(some.front()));
}

// Each vector holds the values that one trial has in the column; missing values are left out.
struct TrialColumn {
  std::string name;
  std::vector<std::vector<double>> values;
};

std::vector<TrialColumn> trial_columns(const MachineRuns& runs, const std::vector<std::string>& names,
                                       std::vector<double> MachineRow::*which) {
  std::vector<TrialColumn> all;
  for (std::size_t j = 0; j < names.size(); ++j) {
    all.push_back({names[j], std::vector<std::vector<double>>(runs.trials.size())});
    for (std::size_t t = 0; t < runs.trials.size(); ++t)
      for (const MachineRow& row : runs.trials[t].rows)
        if (std::isfinite((row.*which)[j])) all.back().values[t].push_back((row.*which)[j]);
  }
  return all;
}

bool stands_still(const std::vector<double>& values) {
  return std::ranges::adjacent_find(values, std::not_equal_to()) == values.end();
}

// A column may be constant in all trials, as a mass is; one that is so in a few of them has lost its sensor there.
std::vector<std::string> stuck_trials(const MachineRuns& runs, const TrialColumn& column) {
  std::vector<std::size_t> stuck;
  std::size_t told = 0;
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    if (column.values[t].size() < fewest_rows) continue;
    ++told;
    if (stands_still(column.values[t])) stuck.push_back(t);
  }
  if (stuck.empty() || 2 * stuck.size() > told) return {};
  return {fmt::format("{}: it is {:.6g} in every row of trial {}{}: did its sensor stand still?", column.name,
                      column.values[stuck.front()].front(), runs.name_of(stuck.front()),
                      stuck.size() > 1 ? fmt::format(", and constant in {} others", stuck.size() - 1) : "")};
}

// Two heaps of trials by the size of a column in them.
struct TrialHeaps {
  std::vector<std::size_t> few;  // trials of the smaller heap
  double apart = 0;              // logarithm of their size over that of the others
  double spread = 0;             // of logarithms within a heap
};

// Splits trials at the widest gap between their sizes. @param sizes  logarithm and trial, two or more
TrialHeaps heaps_of(std::vector<std::pair<double, std::size_t>> sizes) {
  std::ranges::sort(sizes);
  std::size_t upper = 1;  // where the upper heap begins
  for (std::size_t i = 1; i < sizes.size(); ++i)
    if (sizes[i].first - sizes[i - 1].first > sizes[upper].first - sizes[upper - 1].first) upper = i;
  const bool few_above = 2 * upper >= sizes.size();
  const double step = sizes[(upper + sizes.size()) / 2].first - sizes[upper / 2].first;
  TrialHeaps heaps{{},
                   few_above ? step : -step,
                   std::max(sizes[upper - 1].first - sizes.front().first, sizes.back().first - sizes[upper].first)};
  for (std::size_t i = few_above ? upper : 0; i < (few_above ? sizes.size() : upper); ++i)
    heaps.few.push_back(sizes[i].second);
  std::ranges::sort(heaps.few);
  return heaps;
}

// Trials of one machine differ in size by far less than units do: where the sizes fall into two heaps that are a unit's
// factor apart, the smaller heap may be in another unit.
std::vector<std::string> trials_in_other_units(const MachineRuns& runs, const TrialColumn& column) {
  for (const bool first : {false, true}) {  // A trial's first value does not hang on what its machine does next.
    std::vector<std::pair<double, std::size_t>> sizes;
    for (std::size_t t = 0; t < runs.trials.size(); ++t) {
      std::vector<double> values = column.values[t];
      for (double& one : values) one = std::abs(one);
      if (values.empty()) continue;
      const double size = first ? values.front() : median(std::move(values));
      if (size > 0) sizes.emplace_back(std::log(size), t);
    }
    if (sizes.size() < fewest_compared) continue;
    const TrialHeaps heaps = heaps_of(std::move(sizes));
    for (const UnitFactor& unit : unit_factors)
      if (std::abs(heaps.apart - std::log(unit.factor)) < trials_apart &&
          heaps.spread < trials_alike * std::abs(heaps.apart))
        return {fmt::format("{}: its {} in {} are {:.4g} times those of the others: {} in {}?", column.name,
                            first ? "first values" : "values", named_trials(runs, heaps.few), std::exp(heaps.apart),
                            heaps.few.size() == 1 ? "is it" : "are these", unit.words_here)};
  }
  return {};
}

// Compares the first rows with the launch that is stated. The effects of the launch do so, too, but a catalogue may
// leave them out.
std::vector<std::string> other_launches(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> said;
  for (const MachineLaunch& launch : machine.launches) {
    const auto sensor = std::ranges::find(machine.observe, launch.state, &MachineSensor::state);
    if (launch.assumed || sensor == machine.observe.end() || !sensor->sd) continue;
    const auto column = static_cast<std::size_t>(sensor - machine.observe.begin());
    double sum = 0, count = 0;
    for (const MachineTrial& trial : runs.trials)
      if (!trial.rows.empty() && std::isfinite(trial.rows.front().seen[column]))
        sum += trial.rows.front().seen[column], ++count;
    const double error = std::hypot(launch.sd, *sensor->sd) / std::sqrt(count);
    const double off = std::abs(sum / count - launch.mean) / error;
    if (count < static_cast<double>(fewest_compared) || !(error > 0) || !(off > launch_off)) continue;
    said.push_back(fmt::format(
        "launch: {} begins at {:.4g} in the mean of {:.0f} trials, and {:.4g} +- {:.3g} is stated: {:.0f} standard "
        "errors off",
        launch.state, sum / count, count, launch.mean, launch.sd, off));
  }
  return said;
}

// Looks at every column trial by trial, without the machine.
std::vector<std::string> odd_trials(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> states, said;
  for (const MachineSensor& sensor : machine.observe) states.push_back(sensor.state);
  const auto add = [&](std::vector<std::string> sentences) {
    for (std::string& sentence : sentences) said.push_back(std::move(sentence));
  };
  for (const TrialColumn& column : trial_columns(runs, states, &MachineRow::seen)) {
    add(stuck_trials(runs, column));
    add(trials_in_other_units(runs, column));
  }
  for (const TrialColumn& column : trial_columns(runs, machine.inputs, &MachineRow::inputs)) {
    add(trials_in_other_units(runs, column));
    std::vector<double> all;
    for (const std::vector<double>& values : column.values) all.insert(all.end(), values.begin(), values.end());
    if (all.size() >= fewest_rows && stands_still(all))
      said.push_back(fmt::format("{}: it is {} in every row: an input that is constant does not show what it does",
                                 column.name, all.front()));
  }
  return said;
}

// The measured rows from which the next one is known, as the nominal map takes them.
struct NominalSteps {
  std::vector<double> states;
  std::vector<std::vector<double>> values;  // by value, of length 1 or one a row
  std::vector<const MachineRow*> after;
};

NominalSteps nominal_steps(const Machine& machine, const MachineRuns& runs) {
  NominalSteps all;
  for (const MachineParameter& p : machine.parameters) all.values.push_back({p.nominal});
  for (const MachineEffect& effect : machine.effects)
    for (const SuspectedParameter& p : effect.parameters) all.values.push_back({p.neutral});
  const std::size_t inputs = all.values.size();
  all.values.resize(inputs + machine.inputs.size());
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k + 1 < trial.rows.size(); ++k) {
      std::vector<double> state(machine.states.size(), 0.0);
      for (const MachineLaunch& launch : machine.launches) state[machine.state_index(launch.state)] = launch.mean;
      bool known = true;
      for (std::size_t j = 0; j < machine.observe.size(); ++j) {
        known = known && !std::isnan(trial.rows[k].seen[j]);
        state[machine.state_index(machine.observe[j].state)] = trial.rows[k].seen[j];
      }
      if (!known) continue;
      all.states.insert(all.states.end(), state.begin(), state.end());
      all.after.push_back(&trial.rows[k + 1]);
      for (std::size_t i = 0; i < machine.inputs.size(); ++i) all.values[inputs + i].push_back(trial.rows[k].inputs[i]);
    }
  return all;
}

// Returns the next states, NaN where the machine failed.
std::vector<double> next_states(const Machine& machine, const std::vector<double>& states,
                                const std::vector<double>& scores, const std::vector<std::vector<double>>& values) {
  const std::size_t width = machine.states.size(), rows = states.size() / width;
  std::vector<double> next(states.size(), 0.0);
  std::vector<std::uint8_t> failed(rows);
  const std::vector<std::span<const double>> spans(values.begin(), values.end());
  machine.step({rows, states, scores, spans, next, failed});
  for (std::size_t i = 0; i < next.size(); ++i)
    if (failed[i / width]) next[i] = std::numeric_limits<double>::quiet_NaN();
  return next;
}

// Returns them with one score at `z` and the others at zero.
std::vector<double> stepped(const Machine& machine, const NominalSteps& from, std::size_t score, double z) {
  const auto m = static_cast<std::size_t>(machine.scores);
  std::vector<double> scores(from.after.size() * m, 0.0);
  for (std::size_t i = 0; i < from.after.size(); ++i) scores[i * m + score] = z;
  return next_states(machine, from.states, scores, from.values);
}

// Asks the map about a few rows in several ways that must not matter.
class AskedAnew {
 public:
  AskedAnew(const Machine& machine, const NominalSteps& from)
      : machine_(machine),
        states_(machine.states.size()),
        scores_(static_cast<std::size_t>(machine.scores)),
        rows_(std::min(from.after.size(), most_asked)) {
    from_.assign(from.states.begin(), from.states.begin() + at(rows_ * states_));
    for (std::size_t i = 0; i < rows_ * scores_; ++i) noise_.push_back(std::sin(1.7 * static_cast<double>(i + 1)));
    for (const std::vector<double>& values : from.values)
      nominal_.push_back(values.size() == 1 ? values : Values(values.begin(), values.begin() + at(rows_)));
    moved_ = nominal_;
    std::size_t v = 0;
    for (const MachineParameter& p : machine.parameters) {
      // A parameter that is neither fitted nor varies is only ever one number.
      const bool varies = std::ranges::find(machine.may_vary, p.name) != machine.may_vary.end();
      if (p.sd > 0 || varies) move(v, p.sd > 0 ? p.sd : move_share * std::abs(p.nominal), p.lower, p.upper);
      ++v;
    }
    for (const MachineEffect& effect : machine.effects)
      for (const SuspectedParameter& p : effect.parameters)
        move(v++, move_share * (p.upper - p.lower), p.lower, p.upper);
  }

  // Says what of the map's answers hangs on more than its arguments; it is empty where nothing of the kind was seen.
  std::string fault() const {
    if (rows_ == 0) return "";
    const Values plain = asked(from_, noise_, nominal_);
    if (!same(plain, asked(from_, noise_, nominal_)))
      return "it makes something else of the same states and noise when it is asked again; it must be a function of "
             "its arguments alone, and take what it draws from the noise";
    std::vector<std::size_t> backwards, some;
    for (std::size_t i = rows_; i-- > 0;) {
      backwards.push_back(i);
      if (i % 2 == 0) some.push_back(i);
    }
    if (!same(picked(plain, states_, backwards), asked_for(backwards)))
      return "it makes something else of a row when the rows stand in another order; each row must be stepped by "
             "itself, with its own state, noise and parameters";
    if (!close(picked(plain, states_, some), asked_for(some)))
      return "it makes something else of a row when some of the others are not asked for; each row must be stepped by "
             "itself, whatever the mean or the largest of all rows is";
    if (!each_takes_its_own(plain))
      return "it makes something else of a row when parameters are arrays of one number a row than with the same "
             "numbers alone; each row must take its own";
    return "";
  }

  // Lists the numbers of the noise, from 1 on, that changed nothing anywhere.
  std::vector<std::size_t> idle() const {
    std::vector<std::size_t> list;
    for (std::size_t m = 0; m < scores_ && rows_ > 0; ++m)
      if (idles(m, nominal_) && idles(m, moved_)) list.push_back(m + 1);
    return list;
  }

 private:
  using Values = std::vector<double>;
  using Columns = std::vector<Values>;

  static std::ptrdiff_t at(std::size_t i) { return static_cast<std::ptrdiff_t>(i); }
  // Moves a value up by as much as its bounds leave, or down where there is more room.
  void move(std::size_t value, double by, double lower, double upper) {
    double& to = moved_[value][0];
    const double up = std::min(by, upper - to), down = std::min(by, to - lower);
    to += up >= down ? std::max(0.0, up) : -down;
  }
  Values asked(const Values& states, const Values& noise, const Columns& values) const {
    return next_states(machine_, states, noise, values);
  }
  Values largest(const Values& all) const {
    Values most(states_, 0.0);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (std::isfinite(all[i])) most[i % states_] = std::max(most[i % states_], std::abs(all[i]));
    return most;
  }
  bool same(const Values& a, const Values& b) const {
    const Values most = largest(a);
    std::size_t flips = 0;  // Rows at the edge of a failure may fail in one order and not in another.
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (std::isfinite(a[i]) != std::isfinite(b[i])) ++flips;
      if (std::abs(a[i] - b[i]) > same_share * most[i % states_]) return false;
    }
    return flips <= states_ * std::max<std::size_t>(2, rows_ / 50);
  }
  // Rows take nominal and moved values in turn; summed over them, each state must be what it is with these alone. A
  // solver may share its steps among rows, and is as close as its tolerance.
  bool each_takes_its_own(const Values& plain) const {
    const Values moved = asked(from_, noise_, moved_), mixed = asked(from_, noise_, alternating()),
                 most = largest(plain);
    Values wrong(states_, 0.0), apart(states_, 0.0);
    for (std::size_t i = 0; i < plain.size(); ++i) {
      const double right = i / states_ % 2 == 0 ? plain[i] : moved[i];
      if (!std::isfinite(plain[i] - moved[i]) || !std::isfinite(mixed[i])) continue;
      wrong[i % states_] += std::abs(mixed[i] - right);
      apart[i % states_] += 0.5 * std::abs(plain[i] - moved[i]);
    }
    for (std::size_t s = 0; s < states_; ++s)
      if (wrong[s] > mixed_share * apart[s] + solver_share * most[s] * static_cast<double>(rows_)) return false;
    return true;
  }
  bool idles(std::size_t score, const Columns& values) const {
    std::optional<Values> first;
    for (const double z : {-3.0, -1.5, -0.5, 0.5, 1.5, 3.0}) {
      Values noise = noise_;
      for (std::size_t i = 0; i < rows_; ++i) noise[i * scores_ + score] = z;
      const Values next = asked(from_, noise, values);
      if (!first) first = next;
      for (std::size_t i = 0; i < next.size(); ++i)
        if (next[i] != (*first)[i] && !(std::isnan(next[i]) && std::isnan((*first)[i]))) return false;
    }
    return true;
  }
  Values picked(const Values& all, std::size_t width, const std::vector<std::size_t>& rows) const {
    Values some;
    for (const std::size_t i : rows)
      some.insert(some.end(), all.begin() + at(i * width), all.begin() + at((i + 1) * width));
    return some;
  }
  Values asked_for(const std::vector<std::size_t>& rows) const {
    Columns values = nominal_;
    for (Values& one : values)
      if (one.size() > 1) one = picked(one, 1, rows);
    return asked(picked(from_, states_, rows), picked(noise_, scores_, rows), values);
  }
  // Says whether the rows' mean differences are within what a solver that shares its steps among rows leaves.
  bool close(const Values& a, const Values& b) const {
    const Values most = largest(a);
    Values apart(states_, 0.0);
    std::size_t flips = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
      if (std::isfinite(a[i]) != std::isfinite(b[i]))
        ++flips;
      else if (std::isfinite(a[i]))
        apart[i % states_] += std::abs(a[i] - b[i]);
    if (flips > states_ * std::max<std::size_t>(2, rows_ / 50)) return false;
    for (std::size_t s = 0; s < states_; ++s)
      if (apart[s] * static_cast<double>(states_) > solver_share * most[s] * static_cast<double>(a.size()))
        return false;
    return true;
  }
  // Returns the nominal values in every other row and the moved ones between, of those that were moved.
  Columns alternating() const {
    Columns mixed = nominal_;
    for (std::size_t v = 0; v < mixed.size(); ++v) {
      if (nominal_[v][0] == moved_[v][0]) continue;
      mixed[v].assign(rows_, nominal_[v][0]);
      for (std::size_t i = 1; i < rows_; i += 2) mixed[v][i] = moved_[v][0];
    }
    return mixed;
  }

  const Machine& machine_;
  std::size_t states_, scores_, rows_;
  Values from_, noise_;
  Columns nominal_, moved_;
};

// Refuses a map that hangs on more than its arguments, row by row, and says which noise changes nothing.
std::vector<std::string> ask_anew(const Machine& machine, const NominalSteps& from) {
  const AskedAnew map(machine, from);
  if (const std::string fault = map.fault(); !fault.empty()) throw std::invalid_argument("step: " + fault);
  std::vector<std::string> said;
  for (const std::size_t number : map.idle())
    said.push_back(fmt::format("step: number {} of the noise changes nothing: it may not be used", number));
  return said;
}

// Puts the measured next values beside those of the nominal map, and what lies between beside its noise, and asks
// whether one is a unit's factor of the other.
std::vector<std::string> other_units(const Machine& machine, const NominalSteps& from) {
  const std::size_t rows = from.after.size(), d = machine.states.size();
  if (rows < fewest_for_units) return {};
  const std::vector<double> middle = stepped(machine, from, 0, 0);
  std::vector<double> variance(middle.size(), 0.0);
  for (std::size_t m = 0; m < static_cast<std::size_t>(machine.scores); ++m) {
    const std::vector<double> up = stepped(machine, from, m, 1), down = stepped(machine, from, m, -1);
    for (std::size_t i = 0; i < middle.size(); ++i)
      if (std::isfinite(up[i]) && std::isfinite(down[i])) variance[i] += 0.25 * (up[i] - down[i]) * (up[i] - down[i]);
  }
  std::vector<std::string> said;
  const auto suspect = [&](const std::string& state, const char* what, double ratio, double apart) {
    for (const UnitFactor& unit : unit_factors)
      if (std::abs(std::log(std::abs(ratio) / unit.factor)) < apart)
        said.push_back(fmt::format("{}: {} {:.3g} times what the machine makes of the rows before: is it in {}?", state,
                                   what, ratio, unit.words));
  };
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const std::size_t s = machine.state_index(machine.observe[j].state);
    const double error = machine.observe[j].sd.value_or(0);
    std::vector<double> ratios, scatters;
    for (std::size_t i = 0; i < rows; ++i) {
      const double seen = from.after[i]->seen[j], foretold = middle[i * d + s];
      if (std::isnan(seen) || std::isnan(foretold)) continue;
      if (foretold != 0) ratios.push_back(seen / foretold);
      if (const double own = variance[i * d + s] + 2 * error * error; own > 0)
        scatters.push_back(median_deviation_to_sd * (seen - foretold) / std::sqrt(own));
    }
    // Values about zero have ratios of any size and sign, whose median is small by chance.
    if (ratios.size() >= fewest_for_units && median_deviation(ratios) < std::abs(median(ratios)))
      suspect(machine.observe[j].state, "its values are", median(ratios), values_apart);
    if (scatters.size() >= fewest_for_units)  // An effect may have moved all rows alike.
      suspect(machine.observe[j].state, "it scatters", median_deviation(scatters), scatters_apart);
  }
  return said;
}

}  // namespace

std::size_t steps_of(const MachineTrial& trial) {
  return trial.rows.empty() ? 0 : trial.rows.size() - 1 + (trial.outcome == MachineOutcome::failed ? 1 : 0);
}

std::size_t MachineRuns::transitions() const {
  std::size_t count = 0;
  for (const MachineTrial& trial : trials) count += trial.rows.empty() ? 0 : trial.rows.size() - 1;
  return count;
}

std::string MachineRuns::name_of(std::size_t trial) const {
  return trials[trial].name.empty() ? std::to_string(trial + 1) : trials[trial].name;
}

std::size_t MachineRuns::longest() const {
  std::size_t most = 0;
  for (const MachineTrial& trial : trials) most = std::max(most, trial.rows.size());
  return most;
}

bool MachineRuns::timed() const {
  return every_row(*this, [](const MachineRow& row) { return std::isfinite(row.time); });
}

bool MachineRuns::placed() const {
  return every_row(*this, [](const MachineRow& row) { return std::isfinite(row.position); });
}

// The sums are taken in two passes, so that a column far from zero keeps its spread.
ColumnSpread column_spread(const MachineRuns& runs, std::size_t sensor) {
  const std::vector<double> values = column(runs, sensor);
  if (values.empty()) return {};
  const auto count = static_cast<double>(values.size());
  ColumnSpread spread{std::accumulate(values.begin(), values.end(), 0.0) / count, 0};
  double squares = 0;
  for (const double x : values) squares += (x - spread.mean) * (x - spread.mean);
  spread.sd = std::sqrt(squares / count);
  return spread;
}

std::vector<std::string> look_over(const Machine& machine, const MachineRuns& runs) {
  machine.require_valid();
  require_shape(machine, runs);
  require_clock(runs);
  require_one_machine(runs);
  const std::size_t transitions = runs.transitions();
  if (transitions == 0)
    throw std::invalid_argument("runs: no trial has two rows one after the other: there is no transition");
  const auto fitted = static_cast<std::size_t>(
      std::ranges::count_if(machine.parameters, [](const MachineParameter& p) { return p.sd > 0; }));
  if (transitions < fitted)
    throw std::invalid_argument(fmt::format("runs: {} transition{} fewer than the {} parameters to be refitted",
                                            transitions, transitions == 1 ? " is" : "s are", fitted));
  std::vector<std::string> said;
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const std::vector<double> values = column(runs, j);
    if (values.size() < 2)
      throw std::invalid_argument(
          fmt::format("runs: {} has {}", machine.observe[j].state,
                      values.empty() ? "no value in any row" : "one value; every other row lacks it"));
    const auto [least, most] = std::ranges::minmax(values);
    if (least == most)
      throw std::invalid_argument(fmt::format("runs: {} is {} in every row: a column that is constant says nothing",
                                              machine.observe[j].state, least));
  }
  require_launch(machine, runs);
  const NominalSteps from = nominal_steps(machine, runs);
  for (const std::vector<std::string>& sentences :
       {ask_anew(machine, from), doubled_trials(runs), other_units(machine, from), odd_trials(machine, runs),
        other_launches(machine, runs)})
    said.insert(said.end(), sentences.begin(), sentences.end());
  return said;
}

}  // namespace metastable::analysis
