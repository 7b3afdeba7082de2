#pragma once
// What reading landings from a table, and each from a state that does not tell all, does to the expected steps.

#include <span>

#include "analysis/study/chain_summary.h"

namespace metastable::analysis {

/// Relative error of the expected steps from the launch, 0 where the map has neither defect: to first order the
/// visits to every state times the mean difference in expected steps between the true landing and the one read
/// (AnyReturnMap::landing_defect), by weighted draws; two standard errors of it over four randomisations are added. The
/// same of what the state leaves out (AnyReturnMap::memory_defect), with the expected steps two events on.
/// Cost: some thousand landings followed.
/// @param states as in summarize()
double landing_error(const Problem& problem, int phases, std::span<const double> states,
                     const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options);

/// Takes it into the intervals of the expected steps and of the failure rate, and into the status.
void add_landing_error(Metastability& result, double error, double tolerance);

}  // namespace metastable::analysis
