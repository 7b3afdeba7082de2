#include "analysis/walker_model/steps_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string_view>

namespace metastable::analysis {
namespace {

constexpr std::int64_t most_steps = 1'000'000'000;
constexpr std::string_view phase_remedy = "write 1 where leg 1 stands and 2 where leg 2 does";
constexpr dynamics::Range any_input{.low = -1e300, .high = 1e300};

// Returns the index of a word among those there were, which it joins where it is new; -1 for none.
int index_of(std::vector<std::string>& words, std::string_view word) {
  if (word.empty()) return -1;
  const auto at = std::ranges::find(words, word);
  const auto index = static_cast<int>(at - words.begin());
  if (at == words.end()) words.emplace_back(word);
  return index;
}

constexpr std::array<std::string_view, 6> usual_columns{"condition", "trial", "step", "phase", "time_s", "position_m"};

class StepsReader {
 public:
  StepsReader(const ExperimentSource& source, const StepColumns& columns, MachineRuns& runs, Defects& defects)
      : source_(source), columns_(columns), runs_(runs), defects_(defects) {}

  void read() {
    runs_.conditions.clear();
    const std::string file = file_named("steps.csv");
    if (!source_.steps_csv) return defects_.add(file, {}, "there is no such file; walks need it");
    if (const std::string objection = label_objection(columns_.labels, columns_); !objection.empty())
      return defects_.add(file_named("experiment.toml"), {}, objection);
    for (const auto* labels : {&columns_.labels, &columns_.labels_of_call})
      for (const std::string& label : *labels) runs_.labels.push_back({label, {}});
    const std::vector<CsvColumn> all = csv_columns();
    CsvReader csv(file, *source_.steps_csv, all, defects_);
    for (std::size_t c = state_; c < all.size(); ++c)
      if (!csv.has(c))
        defects_.add(file, {1, 1}, fmt::format("there is no column {}, which {}", all[c].name, who_names(c - state_)));
    if (columns_.legs && csv.has(phase_)) runs_.phases = {"1", "2"};
    names_both_legs_ = columns_.legs && csv.has(phase_) && names_both_legs(all);
    while (csv.next()) read_row(csv);
    if (runs_.trials.empty() && defects_.empty()) defects_.add(file, {}, "holds no step");
    if (source_.trials_csv) read_outcomes();
  }

 private:
  enum Columns : std::size_t { condition_, trial_, step_, phase_, time_, position_, state_ };
  using Key = std::pair<std::string, std::int64_t>;

  std::string file_named(const char* name) const { return (std::filesystem::path(source_.folder) / name).string(); }

  // Lists the usual columns, then states, inputs and labels.
  std::vector<CsvColumn> csv_columns() const {
    std::vector<CsvColumn> all;
    for (const std::string_view name : usual_columns) all.push_back({name});
    all[trial_].required = all[step_].required = true;
    if (columns_.legs) all[phase_].remedy = phase_remedy;
    for (const auto& [state, range] : columns_.states) all.push_back({state});
    for (const std::string& input : columns_.inputs) all.push_back({input});
    for (const MachineLabel& label : runs_.labels) all.push_back({label.name});
    return all;
  }

  // Says who names a column behind the usual ones. Phases of a machine that its user brings are no legs, and it has its
  // states and inputs from the call.
  std::string_view who_names(std::size_t column) const {
    const std::size_t states = columns_.states.size(), inputs = states + columns_.inputs.size();
    if (column >= inputs + columns_.labels.size()) return "labels names";
    if (column >= inputs || columns_.legs) return "experiment.toml states";
    return column < states ? "the machine observes" : "the machine takes";
  }

  // Says whether leg 1 stands in a row and leg 2 in another one; it reads the file until that is known.
  bool names_both_legs(const std::vector<CsvColumn>& all) const {
    Defects ignored;
    CsvReader csv("", *source_.steps_csv, all, ignored);
    std::set<std::int64_t> named;
    while (named.size() < 2 && csv.next()) {
      std::optional<std::int64_t> phase;
      if (csv.read(phase_, 1, 2, phase) && phase) named.insert(*phase);
    }
    return named.size() == 2;
  }

  static std::string condition_of(const CsvReader& csv) {
    return csv.text(condition_).empty() ? "all" : std::string(csv.text(condition_));
  }

  void read_row(CsvReader& csv) {
    std::optional<std::int64_t> trial, step;
    std::optional<double> time, position;
    const bool counted = csv.read(trial_, 1, most_steps, trial) && csv.read(step_, 1, most_steps, step);
    MachineRow row;
    read_phase(csv, row);
    csv.read(time_, dynamics::range::time, time);
    csv.read(position_, dynamics::range::position, position);
    std::size_t at = state_;
    for (const auto& [state, range] : columns_.states) {
      std::optional<double> value;
      csv.read(at++, range, value);
      row.seen.push_back(value.value_or(std::nan("")));
    }
    for (std::size_t i = 0; i < columns_.inputs.size(); ++i) {
      std::optional<double> value;
      csv.read(at++, any_input, value);
      row.inputs.push_back(value.value_or(std::nan("")));
    }
    for (MachineLabel& label : runs_.labels) row.labels.push_back(index_of(label.values, csv.text(at++)));
    if (!counted) return;
    row.time = time.value_or(std::nan(""));
    row.position = position.value_or(std::nan(""));
    place(csv, {condition_of(csv), *trial}, *step, std::move(row));
  }

  void read_phase(CsvReader& csv, MachineRow& row) {
    if (!columns_.legs) {
      row.phase = index_of(runs_.phases, csv.text(phase_));
      return;
    }
    std::optional<std::int64_t> phase;
    csv.read(phase_, 1, 2, phase);
    row.phase = phase ? static_cast<int>(*phase) - 1 : -1;
    if (!columns_.leg_is_input) return;
    if (csv.text(phase_).empty())
      csv.refuse(phase_, "is missing: which leg stands, 1 or 2, is given in every row or in none");
    row.inputs = {static_cast<double>(phase.value_or(1))};
  }

  void place(CsvReader& csv, Key key, std::int64_t step, MachineRow row) {
    if (runs_.trials.empty() || key != last_) {
      if (!trials_.emplace(key, runs_.trials.size()).second)
        return csv.refuse(trial_, fmt::format("the rows of trial {} do not stand together", key.second));
      auto at = std::ranges::find(runs_.conditions, key.first);
      if (at == runs_.conditions.end()) at = runs_.conditions.insert(at, key.first);
      runs_.trials.push_back(
          {static_cast<std::size_t>(at - runs_.conditions.begin()), {}, {}, fmt::format("{}", key.second)});
      last_ = key;
    }
    std::vector<MachineRow>& rows = runs_.trials.back().rows;
    if (step != static_cast<std::int64_t>(rows.size()) + 1)
      return csv.refuse(step_, fmt::format("{} is not due: step {} of trial {} is", step, rows.size() + 1, key.second));
    if (names_both_legs_ && row.phase >= 0) require_other_leg(csv, rows, row.phase);
    if (!rows.empty() && row.time <= rows.back().time)
      return csv.refuse(time_, fmt::format("{} does not come after {} of the step before", row.time, rows.back().time));
    rows.push_back(std::move(row));
  }

  // Refuses a leg that does not take turns with the one that the last row with a leg tells.
  static void require_other_leg(CsvReader& csv, const std::vector<MachineRow>& rows, int phase) {
    const auto last = std::find_if(rows.rbegin(), rows.rend(), [](const MachineRow& row) { return row.phase >= 0; });
    if (last == rows.rend()) return;
    const auto apart = last - rows.rbegin() + 1;
    if ((last->phase + apart) % 2 == phase) return;
    csv.refuse(phase_, fmt::format("leg {} does not stand {}after leg {}: a row is missing, or out of order", phase + 1,
                                   apart == 1 ? "" : fmt::format("{} rows ", apart), last->phase + 1));
  }

  void read_outcomes() {
    constexpr CsvColumn columns[] = {{"condition"}, {"trial", true}, {"outcome", true}};
    CsvReader csv(file_named("trials.csv"), *source_.trials_csv, columns, defects_);
    while (csv.next()) {
      std::optional<std::int64_t> trial;
      if (!csv.read(1, 1, most_steps, trial)) continue;
      const auto at = trials_.find({condition_of(csv), *trial});
      if (at == trials_.end()) {
        csv.refuse(1, fmt::format("steps.csv has no trial {}", *trial));
        continue;
      }
      const std::string_view told = csv.text(2);
      std::optional<MachineOutcome>& outcome = runs_.trials[at->second].outcome;
      if (outcome) {
        csv.refuse(1, fmt::format("trial {} was there before", *trial));
        continue;
      }
      if (told == "failed")
        outcome = MachineOutcome::failed;
      else if (told == "stopped")
        outcome = MachineOutcome::stopped;
      else if (told == "lost")
        outcome = MachineOutcome::lost;
      else
        csv.refuse(2, fmt::format("{} is none of failed, stopped, lost", shown_text(told)));
    }
  }

  const ExperimentSource& source_;
  const StepColumns& columns_;
  MachineRuns& runs_;
  Defects& defects_;
  std::map<Key, std::size_t> trials_;
  Key last_;
  bool names_both_legs_ = false;
};

}  // namespace

std::string label_objection(const std::vector<std::string>& labels, const StepColumns& columns) {
  std::set<std::string_view> own(usual_columns.begin(), usual_columns.end()), seen;
  for (const auto& [state, range] : columns.states) own.insert(state);
  own.insert(columns.inputs.begin(), columns.inputs.end());
  for (const std::string& label : labels) {
    if (label.empty()) return "labels: a name is empty";
    if (own.contains(label))
      return fmt::format("labels: {} is a column of its own: a label needs another name", shown_text(label));
    if (!seen.insert(label).second) return fmt::format("labels: {} is there twice", shown_text(label));
  }
  return "";
}

void read_steps(const ExperimentSource& source, const StepColumns& columns, MachineRuns& runs, Defects& defects) {
  StepsReader(source, columns, runs, defects).read();
}

}  // namespace metastable::analysis
