#pragma once
// metastable steps --walker

#include <string>

#include "analysis/walkers/walker_study.h"

namespace metastable::reports {

struct WalkerStepsRequest {
  analysis::WalkerSetting setting;
  markov::MeshStudyOptions study;
  std::string json;     ///< file, "-" for standard output, "" for none
  std::string command;  ///< the command line, for provenance
};

/// Prints gait, expected steps, rate, mixing and what stands behind them.
/// @throws std::runtime_error with one sentence where independent ways disagree: then no number is given
void run_walker_steps(const WalkerStepsRequest& request);

}  // namespace metastable::reports
