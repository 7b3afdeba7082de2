#pragma once
// Keeps the trials that a CSV file of an experiment speaks of, from its columns condition and trial.

#include <cstddef>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

class TrialIndex {
 public:
  struct Entry {
    int number = 0;
    std::size_t condition = 0;  ///< index in the experiment
    std::size_t line = 0;       ///< of its first row
  };
  enum class Rows { one, several };  ///< of a trial in this file

  /// @param experiment  its conditions are looked up; a coast-down without any gets those that the rows name
  /// @param described   false: experiment.toml has defects, so conditions are not held against the rows
  TrialIndex(Experiment& experiment, Rows rows, bool described);

  /// Returns the place among entries() of the row that `csv` stands at; a trial not seen before is appended. Nothing
  /// where the row does not say which trial it belongs to, or says it wrongly, which is reported.
  std::optional<std::size_t> row(CsvReader& csv, std::size_t condition_column, std::size_t trial_column);
  const std::vector<Entry>& entries() const { return entries_; }
  const Entry* find(int number) const;
  /// Says whether every row so far told its trial.
  bool complete() const { return complete_; }
  /// Reports one defect in `file` for each trial that `other` (read from `other_file`) does not have.
  void report_missing(const TrialIndex& other, const std::string& file, const std::string& other_file,
                      Defects& defects) const;

 private:
  std::optional<std::size_t> condition(CsvReader& csv, std::size_t column, std::size_t trial_column);

  Experiment& experiment_;
  Rows rows_;
  bool described_;
  bool open_;  // conditions come from the rows
  bool complete_ = true;
  bool told_ = false;  // that the column condition is missing
  std::vector<Entry> entries_;
  std::unordered_map<int, std::size_t> place_;
  std::size_t last_condition_ = 0, last_entry_ = 0;
};

}  // namespace metastable::analysis
