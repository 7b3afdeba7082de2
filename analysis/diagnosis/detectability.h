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

/// Ranks changes of the experiment (TransitionModel::alternatives) by what they would tell between the fitted cause and
/// its rival, best first: the gain of the fitted size that the rival and the nuisances cannot take up.
std::vector<NextExperiment> next_experiments(const TransitionModel& model, const Fit& cause,
                                             const std::vector<EffectTerm>& rival, int threads, std::uint64_t seed);

}  // namespace metastable::analysis
