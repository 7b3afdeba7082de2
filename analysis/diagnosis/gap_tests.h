#pragma once
// Tests whether there is a gap, before and after recalibration.

#include <cstddef>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

struct CauseRanking;
struct Fit;

/// Says how likely a quadratic form of the nuisances' scores is as large by chance: the prior shrinks each direction of
/// the information.
/// @param gain  2 Delta log likelihood of the recalibration
double recalibration_p_value(const TransitionModel& model, const Fit& as_given, double gain);

/// Puts the tests for a gap together in `d.gap`, which has the map after recalibration, p_recalibration and
/// p_variations; `d.causes` have what the recalibrated model leaves by facet.
/// @param candidates  effects that were considered
void test_for_gap(Diagnosis& d, const CauseRanking& ranking, std::size_t candidates, const Fit& recalibrated);

}  // namespace metastable::analysis
