#pragma once
// Turns rows of a foreign file into the files of an experiment folder.

#include <map>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "reports/import/column_map.h"
#include "reports/import/imported_rows.h"

namespace metastable::reports {

struct ImportOptions {
  Subject subject = Subject::wheel;
  std::string description;                           ///< experiment.toml
  std::string description_file;                      ///< for messages
  bool number_trials = false;                        ///< in the order of their first rows, whatever the file calls them
  int first_collision = 1;                           ///< what the file calls collision or step 1, 0 or 1
  int first_leg = 0;                                 ///< what the file calls leg 0, or phase 1: 0 or 1
  std::map<std::string, std::string> outcomes = {};  ///< the file's word for an outcome, and the folder's
};

struct Imported {
  /// Holds its texts: of walks steps.csv, where angles were told angle.csv instead of collisions.csv.
  analysis::ExperimentSource source;
  struct Counted {
    std::string id;
    std::size_t trials = 0, rows = 0;
  };
  std::vector<Counted> conditions;
  std::size_t trials = 0, rows = 0;
  std::vector<std::string> assumed, notes;  ///< a sentence each
};

/// Everything that reading an experiment folder checks is checked here, and said of the place in the foreign file.
/// @param file  for messages
/// @throws analysis::InputError with all defects
Imported imported_experiment(const std::string& file, std::vector<ImportedRow> rows, const ImportOptions& options);

}  // namespace metastable::reports
