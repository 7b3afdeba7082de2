#include "reports/import/imported_experiment.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "analysis/experiment/csv_field.h"
#include "analysis/experiment/input_error.h"
#include "analysis/motion_capture/angle_file.h"
#include "analysis/walker_model/walk_folder.h"

namespace metastable::reports {
namespace {

using analysis::csv_field;
using analysis::Defects;
using analysis::shown_text;

std::optional<long> whole_number(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number != std::floor(number) || number < 0 ||
      number > 1e9)
    return std::nullopt;
  return static_cast<long>(number);
}

using TrialKey = std::pair<std::string, std::string>;  // condition, trial

TrialKey key_of(const ImportedRow& row) { return {row.condition.value_or(""), row.trial.value_or("")}; }

// Says whether a row names its trial; NaN and NA are no names.
bool is_trial(const std::optional<std::string>& text) {
  return text && *text != "NaN" && *text != "nan" && *text != "NAN" && *text != "NA";
}

// Gives every row the number of its trial, as the file has it or in the order of the rows.
std::vector<long> trial_numbers(const std::vector<ImportedRow>& rows, bool renumber, Defects& defects) {
  std::vector<long> numbers;
  std::map<TrialKey, long> given;
  std::map<long, std::string> condition_of;
  for (const ImportedRow& row : rows) {
    if (!is_trial(row.trial)) {
      defects.add_row(row.place, "trial: is not told");
      if (std::ranges::none_of(rows, [](const ImportedRow& one) { return is_trial(one.trial); })) return {};
      numbers.push_back(0);
      continue;
    }
    if (renumber) {
      numbers.push_back(given.emplace(key_of(row), static_cast<long>(given.size()) + 1).first->second);
      continue;
    }
    constexpr const char* remedy = "; --number-trials numbers them in the order of their first rows";
    const std::optional<long> number = whole_number(*row.trial);
    if (!number)
      defects.add_row(row.place, fmt::format("trial: {} is no whole number from 0{}", shown_text(*row.trial), remedy));
    const std::string& condition = condition_of.emplace(number.value_or(0), row.condition.value_or("")).first->second;
    if (number && condition != row.condition.value_or(""))
      defects.add_row(row.place,
                      fmt::format("trial: {} is of condition {} too, where numbers are of the whole experiment{}",
                                  *number, shown_text(condition), remedy));
    numbers.push_back(number.value_or(0));
  }
  return numbers;
}

bool told_of_conditions(const std::vector<ImportedRow>& rows) {
  return std::ranges::any_of(rows, [](const ImportedRow& row) { return row.condition.has_value(); });
}

// Returns the fields that every file of a folder begins a row with.
std::string begin_of(const ImportedRow& row, long trial, bool condition) {
  return fmt::format("{}{}", condition ? csv_field(row.condition.value_or("")) + "," : "", trial);
}

// Holds "rest" or another outcome of each trial, in the order of the trials' first rows; empty if none is told.
struct Outcomes {
  std::string csv;
  std::vector<std::string> places;  // of each line behind the header
};

Outcomes outcomes_of(const std::vector<ImportedRow>& rows, const std::vector<long>& numbers,
                     const ImportOptions& options, Defects& defects) {
  if (std::ranges::none_of(rows, [](const ImportedRow& row) { return row.outcome.has_value(); })) return {};
  struct Told {
    std::string condition, outcome, place;
  };
  std::map<long, Told> of_trial;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Told& told = of_trial.try_emplace(numbers[i], rows[i].condition.value_or(""), "", rows[i].place).first->second;
    if (!rows[i].outcome) continue;
    const auto word = options.outcomes.find(*rows[i].outcome);
    const std::string outcome = word == options.outcomes.end() ? *rows[i].outcome : word->second;
    const std::vector<std::string> known = outcome_names(options.subject);
    if (std::ranges::find(known, outcome) == known.end())
      defects.add_row(rows[i].place,
                      fmt::format("outcome: {} is none of {}; --outcomes {}={} would say that it is the first",
                                  shown_text(outcome), fmt::join(known, ", "), known.front(), outcome));
    else if (!told.outcome.empty() && told.outcome != outcome)
      defects.add_row(rows[i].place, fmt::format("outcome: {} after {} of the same trial", outcome, told.outcome));
    else
      told.outcome = outcome;
  }
  const bool condition = told_of_conditions(rows);
  Outcomes outcomes{.csv = condition ? "condition,trial,outcome\n" : "trial,outcome\n", .places = {}};
  for (const auto& [number, told] : of_trial) {
    if (told.outcome.empty() && defects.empty())
      defects.add_row(told.place, fmt::format("outcome: is not told of trial {}, but of others", number));
    outcomes.csv += fmt::format("{}{},{}\n", condition ? csv_field(told.condition) + "," : "", number, told.outcome);
    outcomes.places.push_back(told.place);
  }
  return outcomes;
}

std::string number(const std::optional<double>& value) { return value ? fmt::format("{}", *value) : ""; }

std::string less(const std::optional<double>& value, int first) {
  return value ? fmt::format("{}", *value - first) : "";
}

// Says a defect of the folder's files of the line of the foreign file that it comes from.
// @param file  that all of them are from
std::string in_terms_of(const std::string& defect, const std::string& name, const std::string& file,
                        const std::vector<std::string>& places) {
  if (!defect.starts_with(name + ":")) return defect;
  std::size_t line = 0;
  const char* const begin = defect.data() + name.size() + 1;
  const auto [end, error] = std::from_chars(begin, defect.data() + defect.size(), line);
  const std::size_t what = defect.find(": ", static_cast<std::size_t>(end - defect.data()));
  if (error != std::errc() || what == std::string::npos || line > places.size() + 1) return defect;
  return (line < 2 ? file : places[line - 2]) + defect.substr(what);
}

std::string collisions_csv(const std::vector<ImportedRow>& rows, const std::vector<long>& numbers,
                           const ImportOptions& options) {
  const bool condition = told_of_conditions(rows);
  std::string csv = condition ? "condition," : "";
  csv += "trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ImportedRow& row = rows[i];
    fmt::format_to(std::back_inserter(csv), "{},{},{},{},{},{},{}\n", begin_of(row, numbers[i], condition),
                   less(row.collision, options.first_collision - 1), less(row.leg, options.first_leg), number(row.time),
                   number(row.position), number(row.omega_minus), number(row.omega_plus));
  }
  return csv;
}

std::string angle_csv(const std::vector<ImportedRow>& rows, const std::vector<long>& numbers) {
  const bool condition = told_of_conditions(rows);
  std::string csv = condition ? "condition,trial,time_s,angle_rad\n" : "trial,time_s,angle_rad\n";
  for (std::size_t i = 0; i < rows.size(); ++i)
    fmt::format_to(std::back_inserter(csv), "{},{},{}\n", begin_of(rows[i], numbers[i], condition),
                   number(rows[i].time), number(rows[i].angle));
  return csv;
}

// Puts the rows of each trial together, by step, for steps.csv wants them so.
void put_in_order(std::vector<ImportedRow>& rows) {
  std::map<TrialKey, std::size_t> first;
  for (const ImportedRow& row : rows) first.emplace(key_of(row), first.size());
  std::ranges::stable_sort(
      rows, {}, [&](const ImportedRow& row) { return std::pair(first.at(key_of(row)), row.collision.value_or(0)); });
}

std::string steps_csv(const std::vector<ImportedRow>& rows, const std::vector<long>& numbers,
                      const ImportOptions& options) {
  struct Column {
    const char* name;
    std::optional<double> ImportedRow::*member;
    int first;  // what the file calls 1, less 1
  };
  std::vector<Column> columns{{"step", &ImportedRow::collision, options.first_collision - 1}};
  for (const Column& column : {Column{"phase", &ImportedRow::leg, options.first_leg - 1},
                               {"time_s", &ImportedRow::time, 0},
                               {"position_m", &ImportedRow::position, 0},
                               {"half_angle_rad", &ImportedRow::half_angle, 0},
                               {"stance_rate_rad_s", &ImportedRow::stance_rate, 0},
                               {"swing_rate_rad_s", &ImportedRow::swing_rate, 0}})
    if (std::ranges::any_of(rows, [&](const ImportedRow& row) { return (row.*column.member).has_value(); }))
      columns.push_back(column);
  const bool condition = told_of_conditions(rows);
  std::string csv = condition ? "condition,trial" : "trial";
  for (const Column& column : columns) csv += fmt::format(",{}", column.name);
  csv += "\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    csv += begin_of(rows[i], numbers[i], condition);
    for (const Column& column : columns) csv += "," + less(rows[i].*column.member, column.first);
    csv += "\n";
  }
  return csv;
}

// Counts the collisions of each trial where the file does not. The rows of a trial have to stand together: rows that
// are sorted by something else, a file pasted behind itself and two files that use the same numbers would make long
// trials.
void count_collisions(std::vector<ImportedRow>& rows, const std::vector<long>& numbers, int first, Defects& defects) {
  std::map<long, int> so_far;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    int& count = so_far[numbers[i]];
    if (count > 0 && numbers[i] != numbers[i - 1])
      defects.add_row(rows[i].place,
                      fmt::format("trial: {} goes on behind rows of another trial, and no column tells in which order: "
                                  "put the rows of a trial together, or map the column that counts them",
                                  shown_text(rows[i].trial.value_or(""))));
    rows[i].collision = first + count++;
  }
}

// Counts conditions, trials and rows.
void count(Imported& imported, const std::vector<ImportedRow>& rows, const std::vector<long>& numbers) {
  std::set<std::pair<std::string, long>> trials;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string id = rows[i].condition.value_or("");
    auto at = std::ranges::find(imported.conditions, id, &Imported::Counted::id);
    if (at == imported.conditions.end()) at = imported.conditions.insert(at, Imported::Counted{id});
    ++at->rows;
    at->trials += trials.emplace(id, numbers[i]).second;
  }
  imported.rows = rows.size();
  imported.trials = trials.size();
}

// Reads the folder's texts as they will be read. @throws analysis::InputError
void read_back(Imported& imported, Subject subject) {
  if (subject == Subject::walks) {
    imported.notes = analysis::notes_on_walks(*analysis::parse_walks(imported.source));
    return;
  }
  const bool angles = imported.source.angle_csv.has_value();
  analysis::Experiment experiment =
      angles ? analysis::parse_description(imported.source) : analysis::parse_experiment(imported.source);
  if (angles) analysis::parse_angles(imported.source, experiment);
  imported.notes = experiment.notes;
  if (imported.conditions.size() == 1 && experiment.conditions.size() == 1)
    imported.conditions.front().id = experiment.conditions.front().id;
}

}  // namespace

Imported imported_experiment(const std::string& file, std::vector<ImportedRow> rows, const ImportOptions& options) {
  const bool walks = options.subject == Subject::walks;
  const auto told = [&](std::optional<double> ImportedRow::*what) {
    return std::ranges::any_of(rows, [&](const ImportedRow& row) { return (row.*what).has_value(); });
  };
  const bool angles = told(&ImportedRow::angle);
  Defects defects;
  if (rows.empty()) defects.add(file, {}, "holds no row");
  defects.check();
  Imported imported;
  if (angles && std::ranges::none_of(rows, [](const ImportedRow& row) { return row.trial.has_value(); })) {
    for (ImportedRow& row : rows) row.trial = "1";
    imported.assumed.push_back("all frames are of one trial");
  }
  // Walks without a number of the step keep the order of the file; count_collisions() refuses rows that stand apart.
  if (walks && told(&ImportedRow::collision)) put_in_order(rows);
  const std::vector<long> numbers = trial_numbers(rows, options.number_trials, defects);
  defects.check();
  if (options.number_trials)
    imported.assumed.push_back(
        "trials are numbered in the order of their first rows, taken as the order they were run");
  if (!angles && !told(&ImportedRow::collision)) {
    count_collisions(rows, numbers, options.first_collision, defects);
    defects.check();
    imported.assumed.push_back(fmt::format("{} are counted in the order of the rows", walks ? "steps" : "collisions"));
  }
  const Outcomes outcomes = outcomes_of(rows, numbers, options, defects);
  defects.check();

  analysis::ExperimentSource& source = imported.source;
  source.experiment_toml = options.description;
  if (!outcomes.csv.empty()) source.trials_csv = outcomes.csv;
  if (walks)
    source.steps_csv = steps_csv(rows, numbers, options);
  else if (angles)
    source.angle_csv = angle_csv(rows, numbers);
  else
    source.collisions_csv = collisions_csv(rows, numbers, options);
  count(imported, rows, numbers);
  try {
    read_back(imported, options.subject);
  } catch (const analysis::InputError& error) {
    std::vector<std::string> places, lines;
    for (const ImportedRow& row : rows) places.push_back(row.place);
    for (std::string line : error.lines()) {
      line = in_terms_of(line, walks ? "steps.csv" : angles ? "angle.csv" : "collisions.csv", file, places);
      line = in_terms_of(line, "trials.csv", file, outcomes.places);
      constexpr std::string_view description = "experiment.toml";
      if (line.starts_with(description)) line = options.description_file + line.substr(description.size());
      lines.push_back(std::move(line));
    }
    throw analysis::InputError(std::move(lines));
  }
  return imported;
}

}  // namespace metastable::reports
