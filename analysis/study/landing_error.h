#pragma once
// Says what the expected steps owe to landings that are read from a table, and to states that do not tell all.

#include <span>

#include "analysis/study/chain_summary.h"

namespace metastable::analysis {

/// Both are relative to the expected steps from the launch; 0 where the map has no such defect.
struct LandingError {
  double table = 0;  ///< at least 0: by how much reading landings may move them
  Estimate memory;   ///< by how much they change by what the state leaves out
};

/// It is, to first order, the visits to every state times the mean difference in expected steps: between the true
/// landing and the one read (AnyReturnMap::landing_defect), and between the landing after it with and without what the
/// state leaves out (AnyReturnMap::memory_defect). Draws come in eight randomisations: Student's 95 % half-width is
/// part of `table`, and of the interval of `memory`. For the second order `table` is larger by twice its square (true
/// visits differ from the chain's as its steps do), the interval of `memory` wider by its square.
/// Cost: some thousand landings followed.
/// @param states as in summarize()
LandingError landing_error(const Problem& problem, int phases, std::span<const double> states,
                           const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options);

/// Says by how much the logarithm of the expected steps may be less, and more, than a study's value by both; each at
/// least 0.
struct LandingReach {
  double less = 0, more = 0;
};
LandingReach landing_reach(const StepsToRest& steps);

/// Takes them into the intervals of the expected steps and of the failure rate, and into the status. The values stay
/// the chain's; the intervals reach to what `memory` makes of them.
void add_landing_error(Metastability& result, const LandingError& error, double tolerance);

}  // namespace metastable::analysis
