#pragma once
// Simulates a stand-in of the paper's three experiments, whose measurements are not public.

#include <cstdint>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/laboratory_experiment.h"

namespace metastable::analysis {

/// Has the stand-in's contact: eta ~ N(0.54, 0.045^2), mu ~ N(0.352, 0.043^2) under `published`. Not the paper's
/// nominal values, with which that law stops nearly every trial within a few steps: chosen so that the steady speeds
/// are near those of rigid-body wheels and about one trial in ten rests at 7.02 deg, the "intermittent failures" of
/// Sec. III.
Setting stand_in_setting();

/// Returns the conditions of stand_in() with their numbers of trials, for the virtual laboratory.
std::vector<LaboratoryCondition> stand_in_conditions(const Setting& base);

/// Simulates the paper's conditions (Sec. III): "fast-9.59" 51 trials launched at N(5.83, 0.28^2) rad/s, "slow-9.59" 48
/// at N(4.51, 0.36^2), "fast-7.02" 50 at N(7.35, 0.19^2); first 16 collisions each.
/// @param base  everything but slope and launch
/// @param progress  told of each condition by itself
std::vector<SimulatedCondition> stand_in(const Setting& base, std::uint64_t seed, int threads = 0,
                                         const markov::Share& progress = {});

}  // namespace metastable::analysis
