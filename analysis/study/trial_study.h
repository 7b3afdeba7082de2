#pragma once
// Follows drawn trials: a study of its own where noise is too narrow for cells, and what chains are held against.

#include <optional>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"

namespace metastable::analysis {

/// Share of a study that is done when its answer is held against trials.
inline constexpr double before_trials = 0.999;

/// Follows a problem with noise from drawn launches, to the tolerance or to a bounded number of events; nothing where
/// trials are too long for that. The interval is Student's, of independent trials; Problem::follow is followed where
/// there is one, otherwise the map.
std::optional<Metastability> trial_study(const Problem& problem, const StudyOptions& options);

/// Checks a study against events that are followed one by one, if `problem` can follow them: 4000 launches, no further
/// than survival is known. It does so where the errors of a table of landings, or of what states leave out, may move
/// the expected steps by a tenth or more, which an estimate of first order may get wrong. @throws StatesTooCoarse with
/// both numbers if what is followed lies outside the interval of the study by more than 4 standard errors, and without
/// following any where they may move the logarithm of the expected steps by 1
void require_followed(const Problem& problem, const Metastability& study, const StudyOptions& options);

/// Holds the chain's answer against drawn trials. Cells and nodes smear noise that is much narrower than they are, and
/// an extrapolation from them does not show it: if the steps of 4096 trials, counted no further than `survival` is
/// known, contradict the study's interval by more than 4 standard errors, the answer is that of trial_study(); where
/// trials are too long for that, the interval is widened to what the trials say. A study that found no rest is tried
/// with 64 trials of 2000 steps.
Metastability held_against_trials(const Problem& problem, Metastability study, const StudyOptions& options);

}  // namespace metastable::analysis
