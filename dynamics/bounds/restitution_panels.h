#pragma once
// Cuts a truncated normal into panels with proven masses and moments.

#include <vector>

#include "dynamics/bounds/interval.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {

/// Holds one panel [lower, upper] with centre c, and enclosures of E[1; X in it], E[X - c; X in it] and E[(X - c)^2; X
/// in it].
struct MomentPanel {
  double lower = 0, upper = 0, centre = 0;
  Interval weight, first, second;
};

struct PanelCut {
  std::vector<MomentPanel> panels;
  Interval outside;  ///< mass that no panel holds: {0, upper bound}
};

/// Makes panels of restitution: `step` sds wide between 10 sds on either side of the mean, narrower in proportion to
/// eta below 10^-3 and none below 10^-30 (the paper's T_r has a logarithm at 0). A constant is one panel of mass 1.
/// @param step  > 0
/// @throws std::domain_error for a constant that is not above 0, or when the truncated mass is too small to divide by
PanelCut restitution_panels(const TruncatedNormal& restitution, double step);

/// Encloses P(a < Z < b) of the standard normal, a <= b.
Interval normal_between(const Interval& a, const Interval& b);

}  // namespace metastable::dynamics
