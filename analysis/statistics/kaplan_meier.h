#pragma once
// Estimates survival in steps from trials of which some never came to rest.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// One trial: it rested after collision `steps`, or it survived that one and was seen no further (censored: the end
/// of the ramp, or of the recording).
struct ObservedSteps {
  int steps = 0;  ///< >= 1
  bool rested = false;
};

/// Estimates S(n) = P(steps > n) at n = 1, 2, ... up to the longest trial (Kaplan and Meier 1958).
struct SurvivalPoint {
  int steps = 0;
  int at_risk = 0;            ///< trials that met collision n
  int rested = 0;             ///< of these, after it
  double survival = 1;        ///< S(n)
  double standard_error = 0;  ///< Greenwood's
  /// Its 95 % come from Greenwood's variance on the log(-log) scale, before the first rest from the binomial bound.
  double lower = 0, upper = 1;
};
/// @throws std::invalid_argument for no trial, or steps below 1
std::vector<SurvivalPoint> kaplan_meier(std::span<const ObservedSteps> trials);

/// Estimates the expected steps before failure from such trials.
struct ExpectedSteps {
  /// The area under S up to `steady_from` - 1 collisions, and beyond it S / rate: the failure rate is taken as
  /// constant in the steady state. Its 95 % come from trials resampled for the first part, the Jeffreys distribution of
  /// the rate for the second; after no rest at all the one whose bound is exact.
  Estimate from_start;
  Estimate failure_rate;  ///< per steady collision; exact (Clopper and Pearson) 95 % interval
  int steady_rests = 0;   ///< behind failure_rate
  int steady_collisions = 0;
  std::string message;  ///< what the numbers rest on, where it is less than that
};
/// Without a rest in the steady state from_start is infinite and its lower end a 95 % bound. Without a collision there
/// it is the mean of what is seen, exact if all trials rested, else a lower bound.
/// @param steady_from  number of the first collision of the steady state, >= 1
ExpectedSteps expected_steps(std::span<const ObservedSteps> trials, int steady_from, std::uint64_t seed);

}  // namespace metastable::analysis
