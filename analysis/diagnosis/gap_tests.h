#pragma once
// Tests whether there is a gap, before and after recalibration.

#include <cstddef>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

struct CauseRanking;
struct Fit;

/// Says how likely a quadratic form of the nuisances' scores is as large by chance: the prior shrinks each direction of
/// the information.
/// @param gain  2 Delta log likelihood of the recalibration
double recalibration_p_value(const TransitionModel& model, const Fit& as_given, double gain);

/// P-values of the tests for a gap.
struct GapPValues {
  double recalibration = 1;  ///< recalibration_p_value()
  double effects = 1;        ///< of the best single effect (CauseRanking::p_value)
  double where = 1;          ///< of the map after recalibration
  double facets = 1;         ///< facets_p_value()
  double variations = 1;     ///< variations_p_value()
  double pairs = 1;          ///< pairs_p_value()
};

/// Judges the facet with the least p-value, for as many facets; 1 where trials do not suffice.
double facets_p_value(const CauseRanking& ranking, const std::vector<LeftInFacet>& facets);

/// Two effects may hide one another from the scores of each alone: judges the best pair's gain, for all pairs of so
/// many effects; 1 where trials do not suffice.
double pairs_p_value(const CauseRanking& ranking, std::size_t effects, const Fit& recalibrated);

/// Shares the level out over the tests, and sets the p-values of `gap`, none below 1e-12.
void put_together(Diagnosis::Gap& gap, const GapPValues& p, const Rules& rules);

}  // namespace metastable::analysis
