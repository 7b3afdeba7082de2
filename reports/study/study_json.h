#pragma once
// Writes results as JSON.

#include <optional>
#include <string>
#include <vector>

#include "analysis/sensitivity/comparison.h"
#include "analysis/sensitivity/propagation.h"
#include "analysis/sensitivity/rigid_body_check.h"
#include "analysis/sensitivity/sensitivity.h"
#include "analysis/statistics/last_moments.h"
#include "analysis/study/certify.h"
#include "analysis/study/metastability.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Holds what `steps` finds beyond the study, where it is asked for.
struct StepsExtras {
  std::optional<analysis::CertifiedSteps> certified = {};
  std::optional<analysis::Sensitivities> sensitivities = {};
  std::optional<analysis::LastMoments> last_moments = {};
  std::optional<analysis::Propagated> propagated = {};  ///< from the parameters' standard errors
  std::optional<analysis::BesideRigidBodies> rigid_bodies = {};
};

/// Holds what `compare` finds beyond the comparison; the first two are empty without standard errors.
struct CompareExtras {
  std::vector<analysis::Propagated> steps = {};                ///< a setting each
  std::vector<analysis::Propagated> ratios = {};               ///< a contrast each
  std::vector<analysis::BesideRigidBodies> rigid_bodies = {};  ///< a setting each; empty where they were not asked for
};

/// Writes the result of `steps`, indented, with a final line end. "infinite" is written as a string; numbers have as
/// many digits as a double holds. Keys as in the README ("steps --json").
std::string steps_json(const analysis::Metastability& study, const analysis::RestThresholds& thresholds,
                       const Provenance& provenance, const StepsExtras& extras = {});

/// Writes the result of `compare`: "settings" (each as in steps_json) and "contrasts".
std::string compare_json(const analysis::Comparison& comparison,
                         const std::vector<analysis::RestThresholds>& thresholds, const Provenance& provenance,
                         const CompareExtras& extras = {});

}  // namespace metastable::reports
