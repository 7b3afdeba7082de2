#pragma once
// Says how a wheel fails: which leg, which contact, which speeds its last steps have.

#include "analysis/statistics/last_moments.h"
#include "analysis/study/metastability.h"

namespace metastable::analysis {

/// Describes the last six steps of all launches that fail later than in their first step, from the chain of the study's
/// cells (512 a phase at most) and the draws of all its replicates: states by their cells, restitution and friction by
/// the draws, weighted with how likely a step that meets them is the last but k. The most likely path goes through
/// cells; its noise is the draw of the largest density that leads on. Back in the middle of the regime is at or above
/// its median speed, at whichever leg. `reason` says where there is nothing to tell: rest unreachable or unresolved, no
/// noise.
/// @throws markov::ConvergenceError when a solver fails
LastMoments how_it_fails(const Setting& setting, const Metastability& study, const StudyOptions& options);

}  // namespace metastable::analysis
