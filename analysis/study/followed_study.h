#pragma once
// Makes the study of launches that are followed one by one: where there is no noise, or so little that cells smear it.

#include <optional>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"

namespace metastable::analysis {

/// The landing of every state known, whatever the noise? It is asked of the map at some states of every phase
/// (AnyReturnMap::landing_range); a map without scores has no noise, one that does not tell its range counts as noisy.
bool without_noise(const Problem& problem);

/// Does every launch rest at its first event, whatever the noise?
bool rests_at_once(const Problem& problem);

/// Follows a problem without noise, or one that rests_at_once(): the steps are whole, or without end.
///
/// A launch is followed until it rests or until it is known never to. That is known once a whole number of revolutions
/// leads an interval of states around the orbit, or around the limit that its last changes point at, into itself (nine
/// states of the interval are tried; landings that rise with the state need no more than its ends), or once the orbit
/// has come again within 1e-13 (within 1e-10 where Problem::run follows it) for eight revolutions; cycles of up to
/// eight revolutions are looked for. A launch that has shown neither after `most_followed` events (fewer for
/// Problem::run, whose events cost more) leaves the study `rest_unresolved`, with those as the lower end.
///
/// A launch with a spread is cut into intervals of its score whose ends take equally many steps, by bisection; what is
/// left between two ends that differ is the interval of the expected steps. Where steps do not rise with the launch,
/// the change from every second of the first cuts is added to it.
Metastability followed_study(const Problem& problem, const StudyOptions& options);

/// Follows a problem with noise from drawn launches, to the tolerance or to a bounded number of events; nothing where
/// trials are too long for that. The interval is Student's, of independent trials; Problem::follow is followed where
/// there is one, otherwise the map.
std::optional<Metastability> trial_study(const Problem& problem, const StudyOptions& options);

/// Holds the chain's answer against drawn trials. Cells and nodes smear noise that is much narrower than they are, and
/// an extrapolation from them does not show it: if the steps of 4096 trials, counted no further than `survival` is
/// known, contradict the study's interval by more than 4 standard errors, the answer is that of trial_study(); where
/// trials are too long for that, the interval is widened to what the trials say. A study that found no rest is tried
/// with 64 trials of 2000 steps.
Metastability held_against_trials(const Problem& problem, Metastability study, const StudyOptions& options);

}  // namespace metastable::analysis
