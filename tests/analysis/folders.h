#pragma once
// Reads experiment folders that several tests read.

#include <filesystem>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Returns the simulated stand-in of the paper's three experiments.
inline Experiment stand_in_folder() {
  return read_experiment(std::filesystem::path(METASTABLE_TEST_DATA) / "stand-in");
}

}  // namespace metastable::analysis
