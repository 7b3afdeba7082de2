#pragma once
// Turns standard errors of parameters into an interval of the expected steps.

#include <vector>

#include "analysis/sensitivity/parameter.h"
#include "analysis/sensitivity/sensitivity.h"
#include "analysis/study/metastability.h"

namespace metastable::analysis {

/// The knowledge of a parameter: its standard error, > 0, in parameter_unit(). Errors are independent of each
/// other.
struct StandardError {
  Parameter parameter = Parameter::slope;
  double value = 0;
};

/// @throws std::invalid_argument naming the parameter: a standard error that is negative or not finite, given twice, or
/// of a parameter that does not matter() to the setting
void check_standard_errors(const Setting& setting, const std::vector<StandardError>& errors);

/// Says what the parameters' standard errors alone make of a number of expected steps.
struct Propagated {
  double log_sd = 0;  ///< standard error of ln(expected steps)
  Estimate interval;  ///< the value with its 95 % interval, numerical error left out
  struct VarianceShare {
    Parameter parameter;
    double share;  ///< of the variance of ln(expected steps)
  };
  std::vector<VarianceShare> shares;  ///< falling
};

/// Applies the delta method in ln(steps): variance = sum of (derivative * standard error)^2. It is of first order:
/// trust it while the interval is not much wider than a factor of two.
Propagated propagate(double steps, const Sensitivities& sensitivities, const std::vector<StandardError>& errors);

/// Holds one side of a ratio.
struct RatioSide {
  const Setting& setting;
  const Sensitivities& sensitivities;
};
/// Does the same for the ratio `of` / `against` of two settings' expected steps. What has another value in the other
/// setting was measured for itself; what has the same value is the same ramp, wheel or contact, and its error counts by
/// the difference of the two derivatives.
Propagated propagate_ratio(double ratio, const RatioSide& of, const RatioSide& against,
                           const std::vector<StandardError>& errors);

}  // namespace metastable::analysis
