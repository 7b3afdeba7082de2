#include "analysis/machine_model/machine_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/machine_model/asked_map.h"
#include "analysis/machine_model/machine_design.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr double trials_apart = 0.5;                         // of logarithms, of trials that start anywhere
constexpr double trials_alike = 0.4;                         // of that factor's logarithm: spread of trials in one unit
constexpr double next_row = 1.5;                             // gaps from a trial to one that goes on with it, at most
constexpr double launch_off = 4;                             // standard errors: one machine in 16000 by chance
constexpr std::size_t fewest_compared = 4, fewest_rows = 3;  // for trials to be compared; of a trial that stands still
// Gaps between rows are uneven where this share of them is off the usual one by more than the second share. Rows are
// missing where most of these are so near a whole multiple of it. What tells the gaps is in proportion to most of them.
constexpr double uneven_rows = 0.1, uneven_by = 0.2, near_whole = 0.1, most_gaps = 0.8, in_proportion = 0.1;
constexpr std::size_t fewest_gaps = 20, fewest_to_rescale = 10;  // steps, for the gaps and for the unit of an input
// Squares of sizes beyond these overflow, or are lost in the smallest numbers: such a column is in no unit of a
// machine.
constexpr double smallest_span = 1e-100, largest_value = 1e100;

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
        throw std::invalid_argument(fmt::format("time_s: it runs back in trial {}, row {}: {:.12g} comes after {:.12g}",
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

// Effects by phase act on steps whose phase is known, and on no others.
std::vector<std::string> missing_phases(const MachineRuns& runs) {
  std::size_t missing = 0, steps = 0;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k < steps_of(trial); ++k) ++steps, missing += trial.rows[k].phase < 0;
  if (missing == 0 || runs.phases.empty()) return {};
  return {fmt::format("phase: {} of {} steps have none, and effects by phase are not sought in these", missing, steps)};
}

// The time from one row to the next.
struct RowGap {
  double time;
  const MachineRow *from, *to;
};

// Says whether a value of each gap is in proportion to nearly all of them.
template <class ValueOf>
bool tells_gaps(const std::vector<RowGap>& gaps, ValueOf value_of) {
  std::vector<double> ratios;
  for (const RowGap& gap : gaps)
    if (const double value = value_of(gap); std::isfinite(value)) ratios.push_back(value / gap.time);
  if (ratios.empty()) return false;
  const double usual = median(ratios);
  const auto near = std::ranges::count_if(
      ratios, [&](double ratio) { return std::abs(ratio - usual) < in_proportion * std::abs(usual); });
  return static_cast<double>(near) > most_gaps * static_cast<double>(gaps.size());
}

// Says whether an input or a state tells the map how long each step lasts.
bool knows_gaps(const Machine& machine, const std::vector<RowGap>& gaps) {
  for (std::size_t i = 0; i < machine.inputs.size(); ++i)
    if (tells_gaps(gaps, [&](const RowGap& gap) { return gap.from->inputs[i]; }) ||
        tells_gaps(gaps, [&](const RowGap& gap) { return gap.to->inputs[i]; }))
      return true;
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    if (tells_gaps(gaps, [&](const RowGap& gap) { return gap.from->seen[j]; }) ||
        tells_gaps(gaps, [&](const RowGap& gap) { return gap.to->seen[j]; }) ||
        tells_gaps(gaps, [&](const RowGap& gap) { return gap.to->seen[j] - gap.from->seen[j]; }))
      return true;
  return false;
}

// A map that is not told the time step takes a gap where rows are missing for one step. Steps whose durations differ
// otherwise, as a walker's do, are no sign of that.
std::vector<std::string> missing_rows(const Machine& machine, const MachineRuns& runs) {
  std::vector<RowGap> gaps;
  std::vector<double> times;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 1; k < trial.rows.size(); ++k)
      if (const double time = trial.rows[k].time - trial.rows[k - 1].time; time > 0) {
        gaps.push_back({time, &trial.rows[k - 1], &trial.rows[k]});
        times.push_back(time);
      }
  if (gaps.size() < fewest_gaps) return {};
  const double usual = median(times);
  double uneven = 0, whole = 0;
  for (const double time : times) {
    const double multiple = time / usual, nearest = std::round(multiple);
    if (std::abs(multiple - 1) > uneven_by) ++uneven;
    if (nearest > 1 && std::abs(multiple - nearest) < near_whole) ++whole;
  }
  if (uneven < uneven_rows * static_cast<double>(gaps.size()) || whole < most_gaps * uneven ||
      knows_gaps(machine, gaps))
    return {};
  const auto [least, most] = std::ranges::minmax(times);
  return {fmt::format(
      "time_s: {:.0f} of {} gaps between rows are whole multiples of the usual {:.3g} s, as where rows are missing "
      "(from {:.3g} to {:.3g} s); the step map bridges each gap in one step and does not know how long it is: an input "
      "dt_s, the time from a row to the next, would tell it",
      whole, gaps.size(), usual, least, most)};
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
      said.push_back(fmt::format("{}: it is {:.6g} in every row: an input that is constant does not show what it does",
                                 column.name, all.front()));
  }
  return said;
}

using RowColumn = double& (*)(MachineRow&, std::size_t);
double& sensor_of(MachineRow& row, std::size_t which) { return row.seen[which]; }
double& input_of(MachineRow& row, std::size_t which) { return row.inputs[which]; }

// A map may not be defined for other signs of what has one sign only, as a level.
bool has_both_signs(const MachineRuns& runs, RowColumn column, std::size_t which) {
  bool above = false, below = false;
  for (MachineTrial trial : runs.trials)
    for (MachineRow& row : trial.rows) above = above || column(row, which) > 0, below = below || column(row, which) < 0;
  return above && below;
}

// Moves a column by one row to later or earlier rows of its trials.
MachineRuns shifted(const MachineRuns& runs, RowColumn column, std::size_t which, bool later) {
  MachineRuns moved = runs;
  for (MachineTrial& trial : moved.trials) {
    std::vector<MachineRow>& rows = trial.rows;
    if (later) {
      for (std::size_t k = rows.size() - 1; k > 0; --k) column(rows[k], which) = column(rows[k - 1], which);
      rows.erase(rows.begin());
    } else {
      for (std::size_t k = 0; k + 1 < rows.size(); ++k) column(rows[k], which) = column(rows[k + 1], which);
      rows.pop_back();
      trial.outcome.reset();
    }
  }
  return moved;
}

MachineRuns turned_round(const MachineRuns& runs, RowColumn column, std::size_t which) {
  MachineRuns turned = runs;
  for (MachineTrial& trial : turned.trials)
    for (MachineRow& row : trial.rows) column(row, which) = -column(row, which);
  return turned;
}

bool turns(const std::string& unit) {
  return unit.empty() || unit.find("rad") != std::string::npos || unit.find("deg") != std::string::npos;
}

MachineRuns rescaled(const MachineRuns& runs, std::size_t input, double factor) {
  MachineRuns other = runs;
  for (MachineTrial& trial : other.trials)
    for (MachineRow& row : trial.rows) row.inputs[input] *= factor;
  return other;
}

MachineRuns backwards(const MachineRuns& runs) {
  MachineRuns turned = runs;
  for (MachineTrial& trial : turned.trials) {
    std::ranges::reverse(trial.rows);
    trial.outcome.reset();
  }
  return turned;
}

}  // namespace

MachineRuns thinned(const MachineRuns& runs, std::size_t steps) {
  const std::size_t every = std::max<std::size_t>(1, runs.transitions() / std::max<std::size_t>(1, steps));
  MachineRuns some = runs;
  some.trials.clear();
  for (std::size_t t = 0; t < runs.trials.size(); t += every) some.trials.push_back(runs.trials[t]);
  return some;
}

std::vector<MisreadRuns> misread_runs(const Machine& machine, const MachineRuns& runs) {
  MachineRuns long_ones = runs;
  std::erase_if(long_ones.trials, [](const MachineTrial& trial) { return trial.rows.size() < fewest_rows; });
  std::vector<MisreadRuns> all;
  const auto add_column = [&](const std::string& name, RowColumn column, std::size_t which) {
    for (const bool later : {true, false})
      all.push_back({fmt::format("{}: with its values one row {}", name, later ? "later" : "earlier"),
                     "is it one row off?", shifted(long_ones, column, which, later)});
    if (has_both_signs(runs, column, which))
      all.push_back(
          {name + ": with the other sign", "is its sign the other way round?", turned_round(long_ones, column, which)});
  };
  for (std::size_t j = 0; j < machine.observe.size(); ++j) add_column(machine.observe[j].state, sensor_of, j);
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
    add_column(machine.inputs[i], input_of, i);
    for (const UnitFactor& unit : unit_factors)
      if (long_ones.transitions() >= fewest_to_rescale &&
          (!unit.of_angles || turns(machine.unit_of(machine.inputs[i]))))
        all.push_back({fmt::format("{}: with its values {:.3g} times as large", machine.inputs[i], 1 / unit.factor),
                       fmt::format("is {} in {}?", machine.inputs[i], unit.words),
                       rescaled(long_ones, i, 1 / unit.factor)});
  }
  all.push_back(
      {"runs: with the rows of every trial in the opposite order", "do they run backwards?", backwards(long_ones)});
  const auto known = [](const std::vector<double>& values) {
    return std::ranges::all_of(values, [](double x) { return std::isfinite(x); });
  };
  for (MisreadRuns& one : all)
    std::erase_if(one.runs.trials, [&](const MachineTrial& trial) {
      return !known(trial.rows.front().seen) || !std::all_of(trial.rows.begin(), trial.rows.end() - 1,
                                                             [&](const MachineRow& row) { return known(row.inputs); });
    });
  std::erase_if(all, [](const MisreadRuns& one) { return one.runs.trials.empty(); });
  return all;
}

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

bool goes_on(const MachineRuns& runs, std::size_t trial) {
  if (trial == 0 || runs.trials[trial].rows.empty()) return false;
  const std::vector<MachineRow>& before = runs.trials[trial - 1].rows;
  if (before.size() < 2) return false;
  const double last = before.back().time, gap = last - before[before.size() - 2].time;
  const double here = runs.trials[trial].rows.front().time - last;
  return here > 0 && here < next_row * gap;
}

RowPlace row_before(const MachineRuns& runs, std::size_t trial, std::size_t row, std::size_t steps) {
  if (steps <= row) return {trial, row - steps};
  if (!goes_on(runs, trial)) return {trial, 0};
  const std::vector<MachineRow>& before = runs.trials[trial - 1].rows;
  const std::size_t beyond = steps - row;
  const auto known = [](double x) { return std::isfinite(x); };
  const bool there = beyond <= before.size() && std::ranges::all_of(before[before.size() - beyond].inputs, known);
  return there ? RowPlace{trial - 1, before.size() - beyond} : RowPlace{trial, 0};
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
      throw std::invalid_argument(fmt::format("runs: {} is {:.6g} in every row: a column that is constant says nothing",
                                              machine.observe[j].state, least));
    if (most - least < smallest_span || std::max(std::abs(least), std::abs(most)) > largest_value)
      throw std::invalid_argument(
          fmt::format("runs: {} goes from {:.3g} to {:.3g}: values up to {:.0g} that differ by {:.0g} or more are "
                      "expected: is it in another unit than the machine?",
                      machine.observe[j].state, least, most, largest_value, smallest_span));
  }
  require_launch(machine, runs);
  const MapAsked map = ask_map(machine, runs);
  for (const std::vector<std::string>& sentences :
       {map.idle_noise, doubled_trials(runs), map.other_units, odd_trials(machine, runs), other_launches(machine, runs),
        missing_phases(runs), missing_rows(machine, runs)})
    said.insert(said.end(), sentences.begin(), sentences.end());
  return said;
}

}  // namespace metastable::analysis
