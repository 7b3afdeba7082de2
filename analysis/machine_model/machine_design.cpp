#include "analysis/machine_model/machine_design.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>

#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

// A column wraps if it stays within a turn, but for its errors, and jumps by about one turn, while it seldom moves by
// half of one. The numbers assume that the machine turns by less than that in a step.
constexpr double within_turn = 1.05, full_jump = 0.7, half_jump = 0.4, least_span = 0.9;
constexpr std::size_t fewest_jumps = 3, jumps_to_moves = 10;
// An error of half a column's spread is a quarter of its variance, and makes slopes from there as much too flat. A
// column that goes far beyond its first values tells the slopes by its later ones.
constexpr double most_error = 0.5;
constexpr std::size_t most_codes = 8;  // An input of more values is a number even if all are whole.
// Values this far from both neighbours, in spans of the column, are asked about; beyond the second number the usual
// marks for missing values are refused.
constexpr double far_spans = 3, mark_spans = 20;
constexpr std::array marks{99.0, 999.0, 9999.0, 99999.0, 999999.0};  // of either sign
constexpr std::size_t fewest_to_span = 40;                           // So many values tell a column's span.
constexpr double least_within = 0.5;     // A state makes this share of its way within trials where one run was cut.
constexpr std::size_t fewest_first = 5;  // So many first values tell a spread.
// A number is asked about that is there at least so often, in this share of the rows, at so many usual steps from the
// rows beside it; rows are, where this share of them repeats the row before; both where this share of the other values
// is there once.
constexpr std::size_t fewest_marks = 5;
constexpr double mark_share = 0.02, mark_steps = 3, repeated_share = 0.2, nearly_all = 0.9;
constexpr double least_spike = 0.1;  // of a column's span: a value of a sensor that rounds, off the rows beside it

// Fills in means and spreads of the columns.
void measure_columns(MachineDesign& design, const Machine& machine, const MachineRuns& runs) {
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const ColumnSpread column = column_spread(runs, j);
    design.mean.push_back(column.mean);
    design.sd.push_back(column.sd);
    double pairs = 0, first = 0, second = 0;
    for (const MachineTrial& trial : runs.trials)
      for (std::size_t k = 1; k < trial.rows.size(); ++k) {
        const double moved = trial.rows[k].seen[j] - trial.rows[k - 1].seen[j];
        if (std::isnan(moved)) continue;
        ++pairs;
        first += moved;
        second += moved * moved;
      }
    const double drift = first / std::max(1.0, pairs), square = second / std::max(1.0, pairs);
    design.change.push_back(std::sqrt(std::max(0.0, square - drift * drift)));
    design.usual_change.push_back(std::sqrt(square));
  }
}

// Correlates a column, over the steps at which it was measured, with the order of trials, where most of its way over
// all trials is made within these.
double along_order(const MachineDesign& design, const MachineRuns& runs, std::size_t sensor) {
  double count = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0, within = 0, before = 0, began = 0;
  for (const StepPlace& at : design.steps) {
    const double seen = runs.trials[at.trial].rows[static_cast<std::size_t>(at.number) - 1].seen[sensor];
    if (std::isnan(seen)) continue;
    if (count == 0) began = seen;
    if (at.number > 1 && count > 0) within += seen - before;
    before = seen;
    const double run = at.run, y_here = at.seen[sensor];
    ++count;
    x += run, y += y_here;
    xx += run * run, yy += y_here * y_here, xy += run * y_here;
  }
  const double square = count > 0 ? (xx - x * x / count) * (yy - y * y / count) : 0;
  if (!(square > 0) || !(within / (before - began) > least_within)) return 0;
  return (xy - x * y / count) / std::sqrt(square);
}

// Measures the first values of trials that take a step.
FirstValues first_values(const MachineRuns& runs, std::size_t sensor) {
  std::vector<double> values;
  for (const MachineTrial& trial : runs.trials)
    if (steps_of(trial) > 0 && !std::isnan(trial.rows.front().seen[sensor]))
      values.push_back(trial.rows.front().seen[sensor]);
  FirstValues first{values.size(), 0, 0};
  if (values.empty()) return first;
  const auto count = static_cast<double>(values.size());
  first.mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double squares = 0;
  for (const double x : values) squares += (x - first.mean) * (x - first.mean);
  first.sd = std::sqrt(squares / count);
  return first;
}

void measure_place(MachineDesign& design, const MachineRuns& runs) {
  design.timed = runs.timed();
  design.placed = runs.placed();
  std::vector<double> gaps;
  bool first = true;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k < trial.rows.size(); ++k) {
      const MachineRow& row = trial.rows[k];
      design.first_time = first ? row.time : std::min(design.first_time, row.time);
      design.last_time = first ? row.time : std::max(design.last_time, row.time);
      design.first_position = first ? row.position : std::min(design.first_position, row.position);
      design.last_position = first ? row.position : std::max(design.last_position, row.position);
      first = false;
      if (design.timed && k > 0) gaps.push_back(row.time - trial.rows[k - 1].time);
    }
  if (!gaps.empty()) design.usual_gap = median(std::move(gaps));
  design.timed = design.timed && design.usual_gap > 0 && design.last_time > design.first_time;
  design.placed = design.placed && design.last_position > design.first_position;
}

// Measures how inputs go along, and stores those of each step and of the steps before, in sds from their means.
void measure_inputs(MachineDesign& design, const Machine& machine, const MachineRuns& runs) {
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) {
    InputCourse& course = design.inputs.emplace_back();
    std::set<double> values;
    std::map<int, double> of_phase;
    std::vector<double> all;
    const auto then = [&](std::size_t trial, std::size_t row, std::size_t steps) {
      const RowPlace at = row_before(runs, trial, row, steps);
      return runs.trials[at.trial].rows[at.row].inputs[i];
    };
    for (const StepPlace& at : design.steps) {
      const std::vector<MachineRow>& rows = runs.trials[at.trial].rows;
      const auto row = static_cast<std::size_t>(at.number) - 1;
      const double here = all.emplace_back(rows[row].inputs[i]);
      values.insert(here);
      course.by_phase = course.by_phase && of_phase.try_emplace(at.phase, here).first->second == here;
      course.changes = course.changes || here != then(at.trial, row, 1) || here != rows.front().inputs[i];
    }
    course.code = machine.unit_of(machine.inputs[i]).empty() && values.size() <= most_codes &&
                  std::ranges::all_of(values, [](double x) { return x == std::floor(x); });
    const double count = std::max<double>(1, static_cast<double>(all.size()));
    const double mean = std::accumulate(all.begin(), all.end(), 0.0) / count;
    double squares = 0;
    for (const double x : all) squares += (x - mean) * (x - mean);
    const double sd = std::sqrt(squares / count);
    for (StepPlace& at : design.steps)
      for (std::size_t lag = 0; lag < input_lags; ++lag) {
        const auto row = static_cast<std::size_t>(at.number) - 1;
        at.inputs.push_back(sd > 0 ? (then(at.trial, row, lag) - mean) / sd : 0);
      }
  }
}

// Counts the jumps of a column by about a turn; 0 where it leaves the turn, or moves as widely otherwise.
std::size_t jumps_by(const MachineRuns& runs, std::size_t sensor, double turn) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  std::size_t jumps = 0, moves = 0;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k < trial.rows.size(); ++k) {
      const double here = trial.rows[k].seen[sensor];
      if (std::isnan(here)) continue;
      least = std::min(least, here);
      most = std::max(most, here);
      const double moved = k > 0 ? std::abs(here - trial.rows[k - 1].seen[sensor]) : 0;  // NaN after a lost row
      if (moved > full_jump * turn) {
        ++jumps;
      } else if (moved > half_jump * turn) {
        ++moves;
      }
    }
  const double span = most - least;
  return span > least_span * turn && span < within_turn * turn && jumps >= jumps_to_moves * moves ? jumps : 0;
}

// Returns the range of a column between its percents 1 and 99; of none where it has few values.
std::pair<double, double> usual_range(const MachineRuns& runs, std::size_t sensor) {
  std::vector<double> values;
  for (const MachineTrial& trial : runs.trials)
    for (const MachineRow& row : trial.rows)
      if (!std::isnan(row.seen[sensor])) values.push_back(row.seen[sensor]);
  if (values.size() < fewest_to_span) return {0, 0};
  std::ranges::sort(values);
  const std::size_t aside = values.size() / 100 + 1;
  return {values[aside], values[values.size() - 1 - aside]};
}

bool same(const MachineTrial& a, const MachineTrial& b) {
  if (a.rows.size() != b.rows.size() || a.rows.size() < 3) return false;
  for (std::size_t k = 0; k < a.rows.size(); ++k)
    for (std::size_t j = 0; j < a.rows[k].seen.size(); ++j) {
      const double x = a.rows[k].seen[j], y = b.rows[k].seen[j];
      if (!(x == y) && !(std::isnan(x) && std::isnan(y))) return false;
    }
  return true;
}

}  // namespace

std::vector<std::string> far_values(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> asked;
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const auto [low, high] = usual_range(runs, j);
    const double span = high - low;
    if (!(span > 0)) continue;
    std::size_t count = 0;
    double farthest = 0;
    std::string is;
    for (std::size_t t = 0; t < runs.trials.size(); ++t)
      for (std::size_t k = 0; k < runs.trials[t].rows.size(); ++k) {
        const std::vector<MachineRow>& rows = runs.trials[t].rows;
        const double seen = rows[k].seen[j], beyond = std::max(low - seen, seen - high);
        const auto where = [&] {
          return fmt::format("{} is {:g} in trial {}, row {}, where it goes from {:.3g} to {:.3g} otherwise",
                             machine.observe[j].state, seen, runs.name_of(t), k + 1, low, high);
        };
        if (beyond > mark_spans * span && std::ranges::find(marks, std::abs(seen)) != marks.end())
          throw std::invalid_argument(where() + ": give NaN for a value that is missing");
        if (k == 0 || k + 1 == rows.size()) continue;
        const double to = seen - rows[k - 1].seen[j], from = seen - rows[k + 1].seen[j];
        if (!(to * from > 0) || !(std::min(std::abs(to), std::abs(from)) > far_spans * span)) continue;
        ++count;
        if (!(beyond > farthest)) continue;
        farthest = beyond;
        is = where();
      }
    if (count > 0)
      asked.push_back(
          fmt::format("{}{}; it may pass for outliers of a noise, and NaN says that a value is missing: is it a glitch "
                      "of the sensor?",
                      is, count > 1 ? fmt::format(" (one of {} such rows)", count) : ""));
  }
  return asked;
}

std::vector<std::string> wrapping_columns(const Machine& machine, const MachineRuns& runs) {
  constexpr std::array<std::pair<double, const char*>, 2> turns{
      {{2 * std::numbers::pi, "2 pi"}, {360.0, "360 degrees"}}};
  std::vector<std::string> asked;
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    for (const auto& [turn, name] : turns)
      if (const std::size_t jumps = jumps_by(runs, j, turn); jumps >= fewest_jumps)
        asked.push_back(fmt::format(
            "{0}: it jumps by about {1} from one row to the next {2} times and stays within {1}: is it an angle that "
            "wraps? Slopes across a jump are wrong: unwrap it along each trial (numpy.unwrap), and let the step go on "
            "beyond {1}, or, in radians, name it under angles of metastable.machine?",
            machine.observe[j].state, name, jumps));
  return asked;
}

std::string unseen_launches(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> columns;
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const MachineSensor& sensor = machine.observe[j];
    const FirstValues first = first_values(runs, j);
    if (!machine.stated_launch(sensor.state) && first.count >= fewest_first &&
        sensor.sd.value_or(0) > most_error * std::max(first.sd, column_spread(runs, j).sd))
      columns.push_back(sensor.state);
  }
  if (columns.empty()) return "";
  return fmt::format(
      "launch: the first values of {} scatter little beyond their sensor's error, so that they hardly tell where "
      "trials "
      "begin, and slopes of the map come out too flat: can the launch be stated, its mean and sd?",
      fmt::join(columns, ", "));
}

MachineDesign machine_design(const Machine& machine, const MachineRuns& runs) {
  MachineDesign design;
  design.trials = runs.trials.size();
  design.phases = runs.phases;
  design.labels = runs.labels;
  measure_columns(design, machine, runs);
  for (std::size_t j = 0; j < machine.observe.size(); ++j) design.first.push_back(first_values(runs, j));
  measure_place(design, runs);
  const double last = runs.trials.size() > 1 ? static_cast<double>(runs.trials.size() - 1) : 1;
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    design.goes_on.push_back(goes_on(runs, t));
    for (std::size_t k = 0; k < steps_of(runs.trials[t]); ++k) {
      const MachineRow& row = runs.trials[t].rows[k];
      StepPlace place{t,
                      static_cast<int>(k) + 1,
                      static_cast<double>(t) / last - 0.5,
                      row.time,
                      row.position,
                      row.phase,
                      row.labels,
                      {}};
      for (std::size_t j = 0; j < row.seen.size(); ++j)
        place.seen.push_back(
            std::isnan(row.seen[j]) || !(design.sd[j] > 0) ? 0 : (row.seen[j] - design.mean[j]) / design.sd[j]);
      design.steps.push_back(std::move(place));
    }
  }
  for (std::size_t j = 0; j < machine.observe.size(); ++j) design.along_order.push_back(along_order(design, runs, j));
  measure_inputs(design, machine, runs);
  return design;
}

std::vector<double> ahead_of(const MachineDesign& design, std::size_t sensor, double kept) {
  double hidden = 0, seen = 0;  // in sds of the column
  bool begun = false;
  return by_step(design, [&](const StepPlace& at) {
    const double here = at.seen[sensor];  // It is 0 where the value is missing.
    if (at.number == 1) begun = begun && design.goes_on[at.trial];
    if (begun) hidden += (1 - kept) * (seen - hidden);
    if (here == 0) return 0.0;
    if (!begun) hidden = here;
    begun = true;
    seen = here;
    return design.sd[sensor] * (hidden - here);
  });
}

double share_beside_states(const MachineDesign& design, std::size_t sensor, const std::vector<double>& number) {
  constexpr Eigen::Index powers = 4;
  const auto steps = static_cast<Eigen::Index>(design.steps.size());
  const auto sensors = static_cast<Eigen::Index>(design.sd.size());
  Eigen::MatrixXd all(steps, powers + sensors);  // The last column is the number.
  for (Eigen::Index k = 0; k < steps; ++k) {
    const std::vector<double>& seen = design.steps[static_cast<std::size_t>(k)].seen;
    for (Eigen::Index power = 0; power < powers; ++power) all(k, power) = std::pow(seen[sensor], power);
    for (Eigen::Index j = 0, at = powers; j < sensors; ++j)
      if (j != static_cast<Eigen::Index>(sensor)) all(k, at++) = seen[static_cast<std::size_t>(j)];
    all(k, powers + sensors - 1) = number[static_cast<std::size_t>(k)];
  }
  const double square = (all.col(powers + sensors - 1).array() - all.col(powers + sensors - 1).mean()).square().sum();
  if (!(square > 0)) return 0;
  if (design.trials >= trials_of_a_spread) {
    std::map<int, std::pair<double, Eigen::RowVectorXd>> by_number;  // count and sum of a step's rows over the trials
    for (Eigen::Index k = 0; k < steps; ++k) {
      auto& [count, sum] = by_number[design.steps[static_cast<std::size_t>(k)].number];
      sum = count > 0 ? Eigen::RowVectorXd(sum + all.row(k)) : Eigen::RowVectorXd(all.row(k));
      ++count;
    }
    for (Eigen::Index k = 0; k < steps; ++k) {
      const auto& [count, sum] = by_number[design.steps[static_cast<std::size_t>(k)].number];
      all.row(k) -= sum / count;
    }
  }
  const auto by = all.leftCols(powers + sensors - 1);
  const Eigen::VectorXd of = all.col(powers + sensors - 1);
  return (of - by * by.colPivHouseholderQr().solve(of)).squaredNorm() / square;
}

std::string replayed_inputs(const Machine& machine, const MachineDesign& design) {
  for (std::size_t i = 0; i < machine.inputs.size(); ++i)
    if (design.inputs[i].changes && !design.inputs[i].by_phase)
      return fmt::format(
          "no model tells the expected steps: {} was recorded and changes within trials; a simulation would replay it "
          "as it was, whatever the state, and a machine that is held by feedback would fail in it",
          machine.inputs[i]);
  return "";
}

std::vector<std::string> doubled_trials(const MachineRuns& runs) {
  std::multimap<double, std::size_t> by_first;
  std::size_t doubled = 0;
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    if (runs.trials[t].rows.empty() || runs.trials[t].rows[0].seen.empty()) continue;
    const double first = runs.trials[t].rows[0].seen[0];
    const auto [from, to] = by_first.equal_range(first);
    doubled += std::any_of(from, to, [&](const auto& at) { return same(runs.trials[at.second], runs.trials[t]); });
    by_first.emplace(first, t);
  }
  if (doubled == 0) return {};
  return {fmt::format("{} of {} trials are there twice, number by number: was one set of data brought in twice?",
                      doubled, runs.trials.size())};
}

namespace {

// Counts the values of a column, and how often the most frequent of them is there.
struct ValueCounts {
  std::map<double, std::size_t> times;
  std::size_t values = 0;
  std::pair<double, std::size_t> most{0, 0};

  // Says whether nearly all others are there once, as those of a continuous column are.
  bool others_differ(std::size_t without) const {
    return static_cast<double>(times.size()) > nearly_all * static_cast<double>(values - without);
  }
};

ValueCounts counted_values(const MachineRuns& runs, std::size_t sensor) {
  ValueCounts counted;
  for (const MachineTrial& trial : runs.trials)
    for (const MachineRow& row : trial.rows)
      if (const double x = row.seen[sensor]; !std::isnan(x)) {
        ++counted.values;
        if (const std::size_t now = ++counted.times[x]; now > counted.most.second) counted.most = {x, now};
      }
  return counted;
}

// Returns the median distance of a column's neighbouring rows, of those of which one is `mark`, or of the others.
double usual_step(const MachineRuns& runs, std::size_t sensor, double mark, bool from_mark) {
  std::vector<double> steps;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 1; k < trial.rows.size(); ++k) {
      const double before = trial.rows[k - 1].seen[sensor], here = trial.rows[k].seen[sensor];
      if (!std::isnan(before - here) && (before == mark || here == mark) == from_mark)
        steps.push_back(std::abs(here - before));
    }
  return steps.empty() ? 0 : median(std::move(steps));
}

// Counts the rows that hold this value between two others: `all`, and those of them that lie off both to one side, by
// some usual steps and a share of the column's span.
struct Spikes {
  std::size_t all = 0, off = 0;
};
Spikes spikes_at(const MachineRuns& runs, std::size_t sensor, double mark) {
  const auto [low, high] = usual_range(runs, sensor);
  const double reach = std::max(mark_steps * usual_step(runs, sensor, mark, false), least_spike * (high - low));
  Spikes spikes;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 1; k + 1 < trial.rows.size(); ++k) {
      const double before = trial.rows[k - 1].seen[sensor], after = trial.rows[k + 1].seen[sensor];
      if (trial.rows[k].seen[sensor] != mark || !(before != mark && after != mark)) continue;
      ++spikes.all;
      spikes.off += std::min(before, after) - mark > reach || mark - std::max(before, after) > reach;
    }
  return spikes;
}

// A mark for a missing value is the same number again and again, off the rows beside it: any number among values that
// all differ, and 0 or -1 among those of a sensor that rounds.
std::vector<std::string> marks_among_values(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> asked;
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const ValueCounts counted = counted_values(runs, j);
    for (const double mark : std::set{counted.most.first, 0.0, -1.0}) {
      const auto found = counted.times.find(mark);
      const std::size_t times = found == counted.times.end() ? 0 : found->second;
      if (times < fewest_marks || static_cast<double>(times) < mark_share * static_cast<double>(counted.values))
        continue;
      const bool among_others = counted.others_differ(times) &&
                                usual_step(runs, j, mark, true) > mark_steps * usual_step(runs, j, mark, false);
      const Spikes spikes = spikes_at(runs, j, mark);
      const bool off = (mark == 0 || mark == -1) && spikes.off >= fewest_marks &&
                       static_cast<double>(spikes.off) > nearly_all * static_cast<double>(spikes.all);
      if (among_others || off)
        asked.push_back(fmt::format(
            "{}: it is {:g} in {} rows, off the rows beside them{}; NaN says that a value is missing: is it a mark for "
            "that?",
            machine.observe[j].state, mark, times, off ? "" : ", where other values are hardly there twice"));
    }
  }
  return asked;
}

// Rows that repeat the row before to the last digit, where values are hardly there twice otherwise.
std::vector<std::string> repeated_rows(const Machine& machine, const MachineRuns& runs) {
  std::size_t repeated = 0, pairs = 0;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 1; k < trial.rows.size(); ++k) {
      ++pairs;
      repeated += trial.rows[k].seen == trial.rows[k - 1].seen;  // Missing values are like none.
    }
  if (static_cast<double>(repeated) < repeated_share * static_cast<double>(pairs)) return {};
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    if (!counted_values(runs, j).others_differ(repeated)) return {};
  return {
      fmt::format("{} of {} rows repeat the row before to the last digit: is each row there twice, or was a sensor "
                  "read more often than it measures?",
                  repeated, pairs)};
}

}  // namespace

std::vector<std::string> questions_on_values(const Machine& machine, const MachineRuns& runs) {
  std::vector<std::string> asked = wrapping_columns(machine, runs);
  for (const auto& question : {far_values, marks_among_values, repeated_rows})
    std::ranges::copy(question(machine, runs), std::back_inserter(asked));
  if (std::string question = unseen_launches(machine, runs); !question.empty()) asked.push_back(std::move(question));
  return asked;
}

}  // namespace metastable::analysis
