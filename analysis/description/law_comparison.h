#pragma once
// Puts an experiment beside what the contact laws predict for it.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/description/contact_fit.h"
#include "analysis/description/leg_landings.h"
#include "analysis/description/speed_profile.h"
#include "analysis/experiment/experiment.h"
#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// Holds one condition, measured or predicted.
struct LawRow {
  std::string condition;
  std::string source;             ///< "measured", "coulomb, as given", "published, fitted", ...
  std::size_t trials = 0;         ///< 0: no prediction, see `message`
  SpeedSummary steady;            ///< of trial means from collision 13 on [rad/s]
  double collision_sd = 0;        ///< of all speeds from there on [rad/s]
  Estimate rest_share;            ///< of trials that rest, with exact binomial 95 % interval
  bool outcomes_known = true;     ///< false: rest_share says nothing
  std::optional<double> p_speed;  ///< Welch, steady trial means against the measured ones
  std::string message;            ///< why there is no prediction
};

struct LawComparison {
  std::vector<LawRow> rows;  ///< condition by condition, the measured one first
  std::vector<std::pair<dynamics::Law, ContactFit>> fits;
  std::vector<LegRow> legs;  ///< beside `settled` as given, where that is asked for
};

/// Holds every condition against every law, with (eta, mu) as given and as fitted to all conditions (steps from
/// omega_minus to the next). Simulated trials start as the measured ones (stated launch, else mean and sd at collision
/// 1) and are followed to the ramp's end or to the last collision that a trial of the condition reached, whichever
/// comes first.
/// @param trials  simulated trials a row, >= 2
LawComparison compare_laws(const Experiment& experiment, const std::vector<dynamics::Law>& laws, int trials,
                           std::uint64_t seed, int threads, const std::function<void()>& progress = {});

}  // namespace metastable::analysis
