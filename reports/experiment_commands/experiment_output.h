#pragma once
// Writes experiment folders that commands create.

#include <filesystem>

#include "analysis/experiment/experiment.h"
#include "reports/output/output_file.h"

namespace metastable::reports {

/// A folder that holds no experiment yet and gets one, whole or not at all.
class ExperimentOutput {
 public:
  /// @throws OutputError if the folder holds a file of an experiment already, or nothing can be written there: at once
  explicit ExperimentOutput(const std::filesystem::path& folder);
  /// Writes the files there are. Call once. @throws OutputError
  void write(const analysis::ExperimentSource& source);

 private:
  OutputFolder whole_;
};

}  // namespace metastable::reports
