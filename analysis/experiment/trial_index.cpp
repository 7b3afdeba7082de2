#include "analysis/experiment/trial_index.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <ranges>
#include <string>
#include <vector>

namespace metastable::analysis {
namespace {

constexpr std::size_t most_ids_shown = 12;  // in a message

std::vector<std::string> ids_of(const std::vector<Condition>& conditions) {
  std::vector<std::string> ids;
  for (const Condition& condition : conditions) ids.push_back(condition.id);
  return ids;
}

}  // namespace

TrialIndex::TrialIndex(Experiment& experiment, Rows rows, bool described)
    : experiment_(experiment),
      rows_(rows),
      described_(described),
      open_(described && experiment.system == System::coast_down && experiment.conditions.empty()) {}

std::optional<std::size_t> TrialIndex::condition(CsvReader& csv, std::size_t column, std::size_t trial_column) {
  std::vector<Condition>& known = experiment_.conditions;
  if (!described_) return 0;
  const std::string_view id = csv.text(column);
  if (!csv.has(column)) {
    if (open_ && known.empty()) known.emplace_back();
    if (known.size() == 1) return 0;
    if (!told_)
      csv.refuse(trial_column,
                 fmt::format("the column 'condition' is missing and experiment.toml has {} conditions", known.size()));
    told_ = true;
    return std::nullopt;
  }
  if (last_condition_ < known.size() && known[last_condition_].id == id) return last_condition_;
  const auto found = std::ranges::find(known, id, &Condition::id);
  last_condition_ = static_cast<std::size_t>(found - known.begin());
  if (found != known.end()) return last_condition_;
  if (open_ && !id.empty()) {
    known.emplace_back().id = id;
    return last_condition_;
  }
  const std::vector<std::string> ids = ids_of(known);
  csv.refuse(column,
             fmt::format("{}; experiment.toml has: {}{}",
                         id.empty() ? "is empty where the id of a condition is expected"
                                    : fmt::format("unknown condition {}", shown_text(id)),
                         fmt::join(ids | std::views::take(most_ids_shown), ", "),
                         ids.size() > most_ids_shown ? fmt::format(" and {} more", ids.size() - most_ids_shown) : ""));
  return std::nullopt;
}

std::optional<std::size_t> TrialIndex::row(CsvReader& csv, std::size_t condition_column, std::size_t trial_column) {
  std::optional<std::int64_t> number;
  csv.read(trial_column, 0, std::numeric_limits<int>::max(), number);
  const std::optional<std::size_t> of = condition(csv, condition_column, trial_column);
  if (!number || !of) {
    complete_ = false;
    return std::nullopt;
  }
  const int trial = static_cast<int>(*number);
  if (last_entry_ >= entries_.size() || entries_[last_entry_].number != trial) {
    const auto [at, fresh] = place_.try_emplace(trial, entries_.size());
    last_entry_ = at->second;
    if (fresh) {
      entries_.push_back({trial, *of, csv.line()});
      return last_entry_;
    }
  }
  const Entry& entry = entries_[last_entry_];
  if (rows_ == Rows::one) {
    csv.refuse(trial_column, fmt::format("trial {} was there before, in line {}", trial, entry.line));
    return std::nullopt;
  }
  if (entry.condition != *of) {
    csv.refuse(condition_column,
               fmt::format("trial {} is of condition {} in line {}; numbers count over the whole experiment", trial,
                           shown_text(experiment_.conditions[entry.condition].id), entry.line));
    return std::nullopt;
  }
  return last_entry_;
}

const TrialIndex::Entry* TrialIndex::find(int number) const {
  const auto at = place_.find(number);
  return at == place_.end() ? nullptr : &entries_[at->second];
}

void TrialIndex::report_missing(const TrialIndex& other, const std::string& file, const std::string& other_file,
                                Defects& defects) const {
  for (const Entry& entry : entries_) {
    const Entry* match = other.find(entry.number);
    if (match == nullptr)
      defects.add(file, {entry.line, 1}, fmt::format("trial {} is not in {}", entry.number, other_file));
  }
}

}  // namespace metastable::analysis
