#pragma once
// Makes the study of launches that are followed one by one, where there is no noise.

#include <map>

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

/// Shares of launches, or of trials, by the steps that they take.
using StepShares = std::map<double, double>;

/// Fills in what such shares say of the steps: moments, quantiles, survival, and the chance of reaching the course's
/// end.
void fill_steps(const Problem& problem, const StepShares& shares, Metastability& result);

}  // namespace metastable::analysis
