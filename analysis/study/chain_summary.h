#pragma once
// What one sampled chain says: the numbers of a study that need no replicates.

#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"
#include "markov/chain/solver.h"
#include "markov/rows/discretization.h"

namespace metastable::analysis {

struct ChainSteps {
  double from_start = 0;
  double from_quasi_stationary = 0;
  double worst_start = 0;
};

/// Expected steps of a chain whose every state reaches rest. The worst start is the lowest state a survivor can have,
/// at the phase where that is worst; its landings are drawn with `draws` (each at most 16384, the first four).
ChainSteps chain_steps(const markov::AnyReturnMap& map, const markov::StateSpace& space,
                       const markov::SampledChain& sampled, const std::vector<markov::DrawOptions>& draws);

/// Fills everything of `result` that is read off one chain (all but the estimates and their errors).
void summarize(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
               const StudyOptions& options, Metastability& result);

/// The same for a chain of which some launches never come to rest.
void summarize_endless(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
                       const StudyOptions& options, Metastability& result);

}  // namespace metastable::analysis
