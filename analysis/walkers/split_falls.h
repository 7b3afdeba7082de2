#pragma once
// Says how a walker falls from the walks that failed in a study by splitting: any dimension.

#include <vector>

#include "analysis/statistics/last_moments.h"
#include "analysis/walkers/walker_falls.h"
#include "markov/splitting/splitting_study.h"

namespace metastable::analysis {

/// Describes the last steps_of_a_fall steps of what fails from the metastable regime, with 95 % intervals from the
/// rounds; nothing (LastMoments::reason) where these lie so far apart that a median is not known. The chance that a
/// step is bound to fail is not told (NaN). The path is that of the walk whose noise was the most likely of all that
/// failed (least sum of squares).
/// @param noises  one for each score; of maps that draw for themselves none
/// @param study  whose SplittingOptions::last_steps were as many
LastMoments how_it_falls(const markov::BatchMap& map, const std::vector<NamedNoise>& noises,
                         const markov::SplittingStudy& study);

}  // namespace metastable::analysis
