#pragma once
// Turns what a hypothesis gains into evidence for it.

#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"

namespace metastable::analysis {

/// Evidence is the likelihood ratio averaged over an effect's variants and over a normal prior on its p parameters
/// whose expected gain is Rules::expected_gain (so that effects of one and of eight parameters start level), or the one
/// above it that makes the evidence largest (so that no share of a large gain is lost; the local empirical Bayes of
/// Liang et al., J. Am. Stat. Assoc. 103, 410, 2008, eq. 9), by Laplace's approximation: log mean_v exp(gain_v
/// g/(1+g)/2) - p/2 log(1+g), g = max(expected_gain, gain - p) / p. Where an effect has a prior of its own
/// (FreeParameter::prior_sd) its gain has paid for that besides.
/// @param gain  2 Delta penalised log likelihood; that of the best variant is fitted, the others' follow their scores
double evidence_of(const ScannedEffect& scanned, double gain, const Rules& rules);

/// Returns the evidence of an effect without variants. @param parameters  >= 0
double evidence_of_gain(double gain, double parameters, const Rules& rules);

PhaseGain phase_gain(const TransitionModel& model, const Fit& better, const Fit& worse);

/// Returns the gain that counts for a second effect: what it gained beyond Rules::square_error() of what the first one
/// gained in the same phase. @param exact  the part of the first that has no error of form (exact_part)
double earned(const TransitionModel& model, const Fit& pair, const Fit& first, const Fit& exact, const Rules& rules);

/// Foretells earned() of a second effect, from its score test beside the first. @param scanned  that score test
double promised_to_earn(const TransitionModel& model, const ScannedEffect& scanned, const Fit& first, const Fit& exact,
                        const Rules& rules);

}  // namespace metastable::analysis
