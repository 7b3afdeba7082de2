#pragma once
// Holds what varies without a name against the recalibrated model: by scores, and fitted where these see too little.

#include <cstdint>
#include <functional>
#include <vector>

#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "analysis/gap/facet_evidence.h"

namespace metastable::analysis {

/// Scans all of the model's variations.
EffectScan scan_variations(const TransitionModel& model, const Fit& recalibrated, int threads);

/// Says how likely it is that some variation gains as much as the best one does by chance; 1 where there are none or
/// trials do not suffice. Facets judge normal scores; this judges the likelihood, which under laws with an atom (feet
/// that stick) says more.
/// @param gains  by variation: what its scores promise, or what its fit gained
double variations_p_value(const EffectScan& variations, const std::vector<double>& gains, int draws,
                          std::uint64_t seed);
/// Returns what the scores promise, by variation.
std::vector<double> promised_gains(const EffectScan& variations);

/// Says of each of the model's variations alone what it gains over the recalibrated model: as a facet's chi-squared,
/// with its p-value over the variants and its evidence. Those that promise most are fitted; the others have what their
/// scores promise, and no more than the best fitted one: beside a cusp of the likelihood scores promise what no fit
/// gains.
/// @param scan  scan_variations()
/// @param heartbeat  called before every fit, one at a time, from any thread; may throw to stop
std::vector<LeftInFacet> fitted_variations(const TransitionModel& model, const Fit& recalibrated,
                                           const EffectScan& scan, const Rules& rules, int threads,
                                           const std::function<void()>& heartbeat);

/// Says the same of those variations that are sought beside a hypothesis (Variation::beside).
/// @param forgiven  2 Delta log likelihood that an error of the hypothesis' form may leave to each
std::vector<LeftInFacet> variations_beside(const TransitionModel& model, const Fit& fit, double forgiven,
                                           const Rules& rules, int threads, const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
