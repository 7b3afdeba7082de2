#pragma once
// Says what least squares of one-step predictions, as the field does it, would name for the runs of a machine.

#include <string>
#include <vector>

#include "analysis/fitting/stepwise.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Steps the map from every measured row, scores at their mean, and fits what it foretells to the next row by
/// Gauss-Newton steps on the residuals, those of a column weighed by their sd in the recalibrated model; first rows are
/// held against stated launches in the same way. Selects effects forward, six at most, by AICc and by BIC over the sum
/// of squares: n log(sum/n) in place of -2 log likelihood, n residuals. Effects of noise alone (spreads, memory,
/// outliers) leave the residuals as they are and are never named. What the residuals of neighbouring steps and columns
/// share is no part of it: errors of a measured row pass for effects. A thousand residuals take half a second.
/// @param catalogue  ids that may be named; empty: all
/// @return choices "Gauss-Newton AICc" and "Gauss-Newton BIC"; none where a state is not measured, and of fewer than 30
/// or more than 10,000 residuals (steps times measured states)
std::vector<StepwiseChoice> least_squares_selection(const Machine& machine, const MachineRuns& runs,
                                                    const std::vector<std::string>& catalogue);

}  // namespace metastable::analysis
