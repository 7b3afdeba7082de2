#pragma once
// Makes a return map whose landings are known in closed form, and expected steps from rows on nodes.

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "markov/chain/solver.h"
#include "markov/transition_rows/node_rows.h"

namespace metastable::markov::testing {

/// Maps x' = x / 2 + 1 + sd z, rest where x' <= 0; as many phases as wanted, all alike.
struct Linear {
  double sd = 0.3;
  int count = 1;
  std::pair<double, double> state_interval(int) const { return {0, std::numeric_limits<double>::infinity()}; }
  int phases() const { return count; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int, std::span<const double> score) const {
    const double next = state / 2 + 1 + sd * score[0];
    return next > 0 ? std::optional(next) : std::nullopt;
  }
  std::optional<double> rest_probability(double state, int) const {
    return 0.5 * std::erfc((state / 2 + 1) / sd / std::numbers::sqrt2);
  }
};

struct LinearWithDensity : Linear {
  double landing_density(double state, int phase, std::span<const double> next, std::span<double> density) const {
    for (std::size_t k = 0; k < next.size(); ++k) {
      const double z = (next[k] - state / 2 - 1) / sd;
      density[k] = std::exp(-0.5 * z * z) / (sd * std::sqrt(2 * std::numbers::pi));
    }
    return *rest_probability(state, phase);
  }
};

inline LaunchState linear_launch() {
  return {[](double score) { return 2 + 0.1 * score; }, 0};
}

/// Returns the expected steps from the launch.
inline double steps(const IntegratedChain& rows) {
  const ChainSolver solver(rows.chain.chain);
  const std::vector<double> mean = mean_first_passage(solver);
  return 1 + std::inner_product(mean.begin(), mean.end(), rows.chain.launch.after.begin(), 0.0);
}

}  // namespace metastable::markov::testing
