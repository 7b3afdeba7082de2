#pragma once
// Experiments with the compass gait in the virtual laboratory, as folders of walks.

#include <string>
#include <vector>

#include "analysis/walker_model/walk_folder.h"
#include "dynamics/laboratory/walker_laboratory.h"

namespace metastable::analysis {

/// Says how reality departs from the model, and what is told of it.
struct WalkerReality {
  std::vector<dynamics::Effect> effects = {};
  std::vector<dynamics::OutsideEffect> outside = {};
  double launch_spread = 0;                ///< WalkerLaboratorySetup::launch_spread
  std::vector<std::string> left_out = {};  ///< of walk_columns_left_out(): not written
};
/// Lists the names that WalkerReality::left_out may hold: phase, time_s, position_m, outcome.
const std::vector<std::string>& walk_columns_left_out();

/// Returns the laboratory of a stated compass gait, whose walks start near the gait of the model.
/// @throws std::invalid_argument for another walker or terrain, and as dynamics::WalkerLaboratory does
dynamics::WalkerLaboratory walker_laboratory(const WalkerSetting& truth, const WalkerReality& reality,
                                             const WalkOptions& options);

/// Runs all trials in the order they were run. They have the same bits on any number of threads.
std::vector<dynamics::WalkedTrial> run_walks(const dynamics::WalkerLaboratory& laboratory, const WalkOptions& options);

/// Returns the folder of these walks. @param statement  without columns: those of the laboratory's sensors; without
///   launches: the laboratory's, without what an effect does to them
/// @throws std::invalid_argument for an unknown name in `left_out`
WalkFiles laboratory_walks(const dynamics::WalkerLaboratory& laboratory,
                           const std::vector<dynamics::WalkedTrial>& trials, WalkStatement statement,
                           const std::vector<std::string>& left_out);

}  // namespace metastable::analysis
