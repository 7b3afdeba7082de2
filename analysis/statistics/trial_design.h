#pragma once
// Says how many measured values tell two distributions apart.

#include <cstddef>
#include <optional>
#include <vector>

namespace metastable::analysis {

/// A number of trials for each of two settings.
struct TrialDesign {
  double trials = 0;  ///< of each, 2 or more
  double power = 0;   ///< with which a two-sided 5 % Welch test on the means then tells the two apart
};

/// Returns the fewest trials from which on the power is 80 %; nothing where the means do not differ (1e-12, relative).
///
/// Up to 500 trials the test is made of trials drawn from the two distributions (Philox, one seed: 20000 pairs of
/// samples, fewer from 100 trials on), so that the skewness of short lifetimes and the few degrees of freedom of small
/// samples count; two samples that are constant and differ are told apart. The power is then known to 0.003 (100 trials
/// and fewer) to 0.006. Beyond, means are as good as normal: n = (z_0.975 + z_0.8)^2 (var_a + var_b) / (mean_a -
/// mean_b)^2. Cost: some ten million draws at most.
/// @param a, b  probabilities of the values 0, 1, 2, ... (at least one each; std::invalid_argument otherwise)
std::optional<TrialDesign> trials_for_power(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace metastable::analysis
