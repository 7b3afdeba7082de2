#pragma once
// Tells what measured steps keep of omega^2, against a plastic collision: where a wheel departs from every
// single-impact law.

#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Describes some steps of an experiment. A step keeps the share (x' - gain)/x of x = omega^2 before its collision, x'
/// before the next one and `gain` what the stance adds; a plastic collision keeps ((r_g^2 + L1 L2 cos alpha)/(r_g^2 +
/// L2^2))^2.
struct StepBalance {
  std::string of;  ///< condition, leg or slide
  std::size_t steps = 0;
  std::optional<double> after_collision;         ///< mean of omega+^2/omega-^2
  double plastic = 0;                            ///< mean share that a plastic collision keeps
  double median = 0, mean = 0, sd = 0, low = 0;  ///< of kept - plastic; low: its 5 % quantile
  std::optional<double> slide;                   ///< mean distance to the next foot beyond the chord [m]
};

/// Holds correlations of kept - plastic over all steps.
struct StepCorrelations {
  double speed = 0, previous = 0;  ///< with omega-; with the same of the step before
  std::optional<double> after_collision, slide;
};

struct StepBalances {
  std::vector<StepBalance> conditions, legs, slides;  ///< slides: fifths of the steps by their slide; empty if unknown
  StepCorrelations correlation;
};

/// Takes steps from the fourth collision on (launches have died away). @throws std::invalid_argument for a coast-down,
/// for experiments without legs, and with fewer than 20 steps
StepBalances step_balances(const Experiment& experiment);

}  // namespace metastable::analysis
