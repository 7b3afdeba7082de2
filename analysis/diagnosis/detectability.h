#pragma once
// Says what an experiment could see of each effect, what looks alike in it, and which experiment would see more.

#include <cstdint>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/effect_scan.h"

namespace metastable::analysis {

/// Finds the smallest size of each effect that stands out, from the information at the fit (nuisances projected out),
/// and the effects that imitate it: the share of its information along its own direction that the other's parameters
/// explain.
std::vector<Detectability> detectability(const EffectScan& scan, const std::vector<const Candidate*>& candidates,
                                         const Rules& rules);

/// Ranks changed experiments (TransitionModel::alternatives), and several changes of the best one together, by what
/// they would tell between the fitted cause and its rivals, best first: the gain of the fitted size that a rival, the
/// effects that both have and the nuisances cannot take up.
/// @param rivals  hypotheses; those count that have another effect in the place of one of the cause's
std::vector<NextExperiment> next_experiments(const TransitionModel& model, const Fit& cause,
                                             const std::vector<std::vector<EffectTerm>>& rivals, const Rules& rules,
                                             int threads, std::uint64_t seed);

}  // namespace metastable::analysis
