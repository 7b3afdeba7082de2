#pragma once
// Walks on rough ground, one by one, step by step.

#include <cstdint>
#include <vector>

#include "analysis/walkers/walker_study.h"
#include "markov/parallel.h"

namespace metastable::analysis {

struct WalkedStep {
  std::vector<double> state;  ///< in which it begins (WalkerMap's)
  double slope_deg = 0;       ///< met in it
};

struct Walk {
  std::vector<WalkedStep> steps;
  bool fell = false;  ///< in the last step; else it was followed no further
};

struct WalkOptions {
  std::size_t trials = 50;
  std::uint64_t longest = 1000;  ///< steps of a walk
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: all cores; the bits do not depend on it
  markov::Share progress = {};
};

/// Every walk starts in the gait; slopes come by counter (Philox) at trial and step.
/// @throws as study_walker for the setting
std::vector<Walk> simulate_walks(const WalkerSetting& setting, const WalkOptions& options);

}  // namespace metastable::analysis
