#pragma once
// What reading landings from a table does to the expected steps.

#include <span>

#include "analysis/study/chain_summary.h"

namespace metastable::analysis {

/// Relative error of the expected steps from the launch, 0 where the map's landings are exact: to first order the
/// visits to every state times the mean difference in expected steps between the true landing and the one read
/// (AnyReturnMap::landing_defect), by weighted draws; two standard errors of it over four randomisations are added.
/// Cost: some thousand landings followed.
/// @param states as in summarize()
double landing_error(const Problem& problem, int phases, std::span<const double> states,
                     const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options);

/// Takes it into the intervals of the expected steps and of the failure rate, and into the status.
void add_landing_error(Metastability& result, double error, double tolerance);

}  // namespace metastable::analysis
