#pragma once
// Tells from which launches and slopes on rest is out of reach.

#include <optional>

#include "analysis/study/metastability.h"

namespace metastable::analysis {

/// Says what else is known of a setting's rest, beside its study.
struct RestThresholds {
  std::optional<double> safe_speed;      ///< launches at least this fast never come to rest [rad/s]
  std::optional<double> safe_slope_deg;  ///< steeper ramps have such launches [deg]
  bool slope_sought = true;              ///< false under `settled`: every slope would need a table of landings
};

/// Takes the speed from the study, the slope from safe_slope_deg(): a bisection.
/// @throws std::bad_optional_access for a study without a setting
RestThresholds rest_thresholds(const Metastability& study);

}  // namespace metastable::analysis
