#pragma once
// Finds which inputs make an output vary, by Sobol' indices of groups of inputs.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

/// Holds shares of the output's variance (Sobol' 1993). Sampling may put estimates a little outside [0, 1].
struct SobolIndex {
  Estimate first;  ///< Var(E[output | group]) / Var(output): what the group does on its own
  Estimate total;  ///< E[Var(output | all other groups)] / Var(output): with its interactions
};

struct SobolResult {
  double mean = 0, sd = 0;        ///< of the output
  std::vector<SobolIndex> group;  ///< empty where the output does not vary
};

struct SobolOptions {
  std::size_t samples = 8192;  ///< rows of each of the two input matrices, split over 16 blocks; >= 32
  std::uint64_t seed = 1;
  int threads = 0;  ///< the same bits on any number
};

/// Uses pick-freeze on two independent matrices A and B of uniform inputs (Philox): first-order by Saltelli et
/// al. (2010), total by Jansen (1999); 95 % t-intervals over 16 blocks. (groups + 2) x samples evaluations.
/// @param group_sizes  inputs of each group, in order
/// @param model        (inputs in (0, 1), outputs to fill); called from several threads
/// @throws std::invalid_argument for too few samples
std::vector<SobolResult> sobol_indices(const std::vector<std::size_t>& group_sizes, std::size_t outputs,
                                       const std::function<void(std::span<const double>, std::span<double>)>& model,
                                       const SobolOptions& options);

}  // namespace metastable::analysis
